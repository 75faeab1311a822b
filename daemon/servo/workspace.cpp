// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/workspace.hpp"

#include <algorithm>
#include <cmath>

namespace wrenchd {

Pose Workspace::update(const Pose& X_BH, double dt_s) noexcept {
  if (clutched_) return X_WH_;
  if (resume_pending_) update_base(X_WH_, X_BH);
  resume_pending_ = false;
  if (scale_ != target_scale_) {
    const Pose X_WH = {X_WB_.rotation * X_BH.rotation,
                       X_WB_.translation_m + scale_ * (X_WB_.rotation * X_BH.translation_m)};
    const double step = std::max(dt_s, 0.0) * scale_rate_per_s_;
    scale_ += std::clamp(target_scale_ - scale_, -step, step);
    update_base(X_WH, X_BH);
  }
  if (scale_ == 1.0) {
    X_WH_ = X_WB_ * X_BH;
  } else {
    X_WH_.rotation = X_WB_.rotation * X_BH.rotation;
    X_WH_.translation_m = X_WB_.translation_m + scale_ * (X_WB_.rotation * X_BH.translation_m);
  }
  return X_WH_;
}

void Workspace::set_scale(double scale) noexcept {
  if (scale == target_scale_) return;
  target_scale_ = scale;
  scale_rate_per_s_ = std::abs(scale - scale_) / kScaleRamp_s;
}

/// Chooses X_WB so that the handle at X_BH maps to X_WH.
void Workspace::update_base(const Pose& X_WH, const Pose& X_BH) noexcept {
  X_WB_.rotation = (X_WH.rotation * X_BH.rotation.conjugate()).normalized();
  X_WB_.translation_m = X_WH.translation_m - scale_ * (X_WB_.rotation * X_BH.translation_m);
}

void Workspace::disengage_clutch(const Pose& X_WH) noexcept {
  clutched_ = false;
  resume_pending_ = true;
  X_WH_ = X_WH;
}

void Workspace::recentre() noexcept {
  X_WB_ = X_WB_configured_;
  scale_ = target_scale_;
  resume_pending_ = false;
}

Wrench Workspace::wrench_on_hand(const Wrench& F_H_W) const noexcept {
  const Wrench F_B = expressed(X_WB_.rotation.conjugate(), F_H_W);
  return scale_ == 1.0 ? F_B : Wrench{scale_ * F_B.force_N, F_B.torque_Nm};
}

}  // namespace wrenchd
