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
class PinnedWatch {
 public:
  /// The limits; 0: the device has no motors for it.
  PinnedWatch(double max_force_N, double max_torque_Nm) noexcept
      : pinning_force_N_(kPinningShare * max_force_N), pinning_torque_Nm_(kPinningShare * max_torque_Nm) {}

  /// F: that goes out.
  FaultSet look(const Wrench& F, const Pose& X_BH, TimePoint now) noexcept;

 private:
  static constexpr double kPinningShare = 0.95;

  bool pushes_fully(const Wrench& F) const noexcept;

  double pinning_force_N_;
  double pinning_torque_Nm_;
  Pose X_BH_;  ///< where it began
  std::optional<TimePoint> since_;
};

}  // namespace wrenchd
