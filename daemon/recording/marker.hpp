// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>

#include "core/clock.hpp"
#include "daemon/control/json_rpc.hpp"

namespace wrenchd {

/// Bounds of a marker.
inline constexpr std::size_t kMarkerLabelBytes = 120;
inline constexpr std::size_t kMarkerConditions = 16;
inline constexpr std::size_t kConditionNameBytes = 32;
inline constexpr std::size_t kConditionTextBytes = 64;

/// Checks a marker of an experiment: its label, and its conditions, an object of numbers and texts. A
/// condition is named like a column: letters, digits and underscores, not first a digit. Throws
/// std::invalid_argument with the reason and the remedy. Not RT-safe: allocates.
void check_marker(const std::string& label, const Json& conditions);

/// Bounds the rate of markers: kBurst at once, and kPerSecond over time. For one thread at a time.
class MarkerRate {
 public:
  static constexpr double kBurst = 50.0;
  static constexpr double kPerSecond = 20.0;

  /// Returns true if a marker is permitted now. RT-safe.
  bool admit(TimePoint now) noexcept;

 private:
  double credit_ = kBurst;
  TimePoint last_{};
};

}  // namespace wrenchd
