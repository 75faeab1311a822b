// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace wrenchd {

/// A key a table may hold. The unit is empty for a pure number or a text.
struct KnownKey {
  std::string name;
  std::string unit;  ///< as key names spell it: "N_per_m"
};

/// A guess at what an unknown key was meant to be.
struct NearestKey {
  std::string name;    ///< the known key that was probably meant; empty: no idea
  std::string advice;  ///< "give it in N as 'max_force_N'", "did you mean 'rate_Hz'?", "known keys here: ..."
};

/// The unit at the end of a key name: "N_per_m" for "linear_N_per_m", empty where there is none.
std::string_view unit_of(std::string_view key);

/// A unit as people write it: "N.s/m" for "N_s_per_m".
std::string readable_unit(std::string_view unit);

/// Same stem with another unit first, then the smallest number of edits, then the list of what is known.
NearestKey nearest_key(std::string_view unknown, const std::vector<KnownKey>& known);

}  // namespace wrenchd
