// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/workspace.hpp"

#include <algorithm>
#include <cmath>

namespace wrenchd {

Pose Workspace::follow(const Pose& X_BH, double dt_s) noexcept {
  if (clutched_) return X_WH_;
  if (goes_on_) hold(X_WH_, X_BH);
  goes_on_ = false;
  if (scale_ != scale_asked_) {
    const Pose X_WH = {X_WB_.rotation * X_BH.rotation,
                       X_WB_.translation_m + scale_ * (X_WB_.rotation * X_BH.translation_m)};
    const double step = std::max(dt_s, 0.0) * scale_per_s_;
    scale_ += std::clamp(scale_asked_ - scale_, -step, step);
    hold(X_WH, X_BH);
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
  if (scale == scale_asked_) return;
  scale_asked_ = scale;
  scale_per_s_ = std::abs(scale - scale_) / kRamp_s;
}

/// Puts the base where the handle at X_BH is at X_WH.
void Workspace::hold(const Pose& X_WH, const Pose& X_BH) noexcept {
  X_WB_.rotation = (X_WH.rotation * X_BH.rotation.conjugate()).normalized();
  X_WB_.translation_m = X_WH.translation_m - scale_ * (X_WB_.rotation * X_BH.translation_m);
}

void Workspace::clutch_out(const Pose& X_WH) noexcept {
  clutched_ = false;
  goes_on_ = true;
  X_WH_ = X_WH;
}

void Workspace::recentre() noexcept {
  X_WB_ = X_WB_0_;
  scale_ = scale_asked_;
  goes_on_ = false;
}

Wrench Workspace::on_the_hand(const Wrench& F_H_W) const noexcept {
  const Wrench F_B = expressed(X_WB_.rotation.conjugate(), F_H_W);
  return scale_ == 1.0 ? F_B : Wrench{scale_ * F_B.force_N, F_B.torque_Nm};
}

}  // namespace wrenchd
