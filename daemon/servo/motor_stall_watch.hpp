// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "core/clock.hpp"
#include "core/fault.hpp"
#include "core/pose.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// Detects stalled motors: nearly the maximum wrench, and a handle that does not move.
class MotorStallWatch {
 public:
  /// max_force_N, max_torque_Nm: limits of the wrench; 0 if the device has no such motors. RT-safe.
  MotorStallWatch(double max_force_N, double max_torque_Nm) noexcept
      : stall_force_N_(kStallFraction * max_force_N), stall_torque_Nm_(kStallFraction * max_torque_Nm) {}

  /// Returns motors_stalled if |F| is near its limit and the handle stays within 1 mm and 20 mrad for
  /// kMotorsStalled. F: wrench sent in this tick. RT-safe.
  FaultSet check(const Wrench& F, const Pose& X_BH, TimePoint now) noexcept;

 private:
  static constexpr double kStallFraction = 0.95;

  bool force_near_limit(const Wrench& F) const noexcept;

  double stall_force_N_;                  ///< Force from which the motors can stall; 0 disables the check.
  double stall_torque_Nm_;                ///< Torque from which the motors can stall; 0 disables the check.
  Pose X_BH_reference_;                   ///< Handle pose at still_since_.
  std::optional<TimePoint> still_since_;  ///< Start of the current standstill; empty without a large wrench.
};

}  // namespace wrenchd
