// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "core/clock.hpp"
#include "core/fault.hpp"
#include "core/pose.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// Looks for a hand that is held: all the force the device may give, and a handle that does not move. RT
/// safe.
class MotorStallWatch {
 public:
  /// The limits; 0: the device has no motors for it.
  MotorStallWatch(double max_force_N, double max_torque_Nm) noexcept
      : stall_force_N_(kStallFraction * max_force_N), stall_torque_Nm_(kStallFraction * max_torque_Nm) {}

  /// F: that goes out.
  FaultSet check(const Wrench& F, const Pose& X_BH, TimePoint now) noexcept;

 private:
  static constexpr double kStallFraction = 0.95;

  bool force_near_limit(const Wrench& F) const noexcept;

  double stall_force_N_;
  double stall_torque_Nm_;
  Pose X_BH_reference_;  ///< where it began
  std::optional<TimePoint> still_since_;
};

}  // namespace wrenchd
