// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace wrenchd {

/// A key that a table may have. The unit is empty for a dimensionless number or a text.
struct KnownKey {
  std::string name;
  std::string unit;  ///< unit in the spelling of key names: "N_per_m"
};

/// Suggestion for an unknown key.
struct NearestKey {
  std::string name;    ///< the known key that was probably meant; empty: no suggestion
  std::string advice;  ///< "give it in N as 'max_force_N'", "did you mean 'rate_Hz'?", "known keys here: ..."
};

/// Unit at the end of a key name: "N_per_m" for "linear_N_per_m"; empty if there is none.
std::string_view unit_of(std::string_view key);

/// Unit in common notation: "N.s/m" for "N_s_per_m".
std::string readable_unit(std::string_view unit);

/// The known key with the same stem and another unit; otherwise the key with the fewest edits; otherwise the
/// list of all known keys. Not RT-safe: allocates.
NearestKey nearest_key(std::string_view unknown, const std::vector<KnownKey>& known);

/// The name that was probably meant by a mistyped one: the only one that begins with it, otherwise the one
/// with the fewest edits, upper and lower case alike. Empty: no name is near. Not RT-safe: allocates.
std::string nearest_name(std::string_view unknown, const std::vector<std::string>& known);

/// Returns "; did you mean 'NAME'?", or "" if no name is near. Not RT-safe: allocates.
std::string nearest_name_advice(std::string_view unknown, const std::vector<std::string>& known);

}  // namespace wrenchd
