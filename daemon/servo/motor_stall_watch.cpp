// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/motor_stall_watch.hpp"

#include "core/watch_limits.hpp"

namespace wrenchd {
namespace {

constexpr double kStill_m = 1e-3;
constexpr double kStill_rad = 2e-2;

}  // namespace

FaultSet PinnedWatch::look(const Wrench& F, const Pose& X_BH, TimePoint now) noexcept {
  const bool moved = !since_ || (X_BH.translation_m - X_BH_.translation_m).norm() > kStill_m ||
                     X_BH.rotation.angularDistance(X_BH_.rotation) > kStill_rad;
  if (!pushes_fully(F)) {
    since_.reset();
    return 0;
  }
  if (moved) {
    X_BH_ = X_BH;
    since_ = now;
  }
  if (now - *since_ <= kPinned) return 0;
  since_.reset();
  return bit(Fault::pinned);
}

bool PinnedWatch::pushes_fully(const Wrench& F) const noexcept {
  return (pinning_force_N_ > 0.0 && F.force_N.norm() >= pinning_force_N_) ||
         (pinning_torque_Nm_ > 0.0 && F.torque_Nm.norm() >= pinning_torque_Nm_);
}

}  // namespace wrenchd
