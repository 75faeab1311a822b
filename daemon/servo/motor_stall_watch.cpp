// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/motor_stall_watch.hpp"

#include "core/watch_limits.hpp"

namespace wrenchd {
namespace {

constexpr double kStill_m = 1e-3;
constexpr double kStill_rad = 2e-2;

}  // namespace

FaultSet MotorStallWatch::check(const Wrench& F, const Pose& X_BH, TimePoint now) noexcept {
  const bool moved = !still_since_ ||
                     (X_BH.translation_m - X_BH_reference_.translation_m).norm() > kStill_m ||
                     X_BH.rotation.angularDistance(X_BH_reference_.rotation) > kStill_rad;
  if (!force_near_limit(F)) {
    still_since_.reset();
    return 0;
  }
  if (moved) {
    X_BH_reference_ = X_BH;
    still_since_ = now;
  }
  if (now - *still_since_ <= kMotorsStalled) return 0;
  still_since_.reset();
  return bit(Fault::motors_stalled);
}

bool MotorStallWatch::force_near_limit(const Wrench& F) const noexcept {
  return (stall_force_N_ > 0.0 && F.force_N.norm() >= stall_force_N_) ||
         (stall_torque_Nm_ > 0.0 && F.torque_Nm.norm() >= stall_torque_Nm_);
}

}  // namespace wrenchd
