// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "config/settings.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// One number or word of [rendering] or [wrench] that can change while the loop runs. A gain, which the file
/// states as a table, has two of them.
struct RenderingValue {
  /// A number or a word; the matrix of a gain that is not two numbers on its diagonal.
  using Value = std::variant<double, std::string, Matrix6d>;

  std::string_view name;  ///< dotted keys of wrenchd.toml: "wrench.stiffness.linear_N_per_m"
  Value (*read)(const Settings& settings);
  /// Returns why the present law or method does not use the value; empty: it uses the value.
  std::string (*unused_reason)(const Settings& settings);

  /// Unit in common notation: "N/m"; empty: none.
  std::string unit() const;
};

/// All values, in the order of wrenchd.toml. Not RT-safe: allocates at the first call.
std::span<const RenderingValue> rendering_values();

/// Returns what the loader accepts: "a number from 0 to 100 N", "\"pid\" or \"energy\"". Not RT-safe:
/// allocates.
std::string expected_text(const RenderingValue& value);

/// Returns the words that the loader accepts; empty: the value is a number. Not RT-safe: allocates.
std::vector<std::string> accepted_words(const RenderingValue& value);

/// A value that differs between two settings.
struct ChangedValue {
  const RenderingValue* value;
  RenderingValue::Value before, now;
};

/// Returns the values that differ, in the order of rendering_values(). Not RT-safe: allocates.
std::vector<ChangedValue> changed_values(const Settings& before, const Settings& now);

}  // namespace wrenchd
