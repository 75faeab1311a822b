// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/pairs/motion_predictor.hpp"

#include <algorithm>

namespace wrenchd {
namespace {

/// How much the last tick counts among those before it: for the hand's velocity (at least), its acceleration,
/// the drift.
constexpr double kNewest = 0.3;
constexpr double kNewestMore = 0.1;
constexpr double kNewestDrift = 0.1;

}  // namespace

void ExpectedMotion::learn_late(const Pose& X_WP) noexcept {
  if (!known()) return;
  const Vector3d hand_turn = small_rotation_vector(X_WP_.rotation.conjugate() * X_WP.rotation);
  const Pose X_WT = {(rotation_from(drift_turn_) * X_WT_.rotation * rotation_from(hand_turn)).normalized(),
                     X_WT_.translation_m + X_WP.translation_m - X_WP_.translation_m + drift_m_};
  learn(X_WT, X_WP);
}

void ExpectedMotion::learn(const Pose& X_WT, const Pose& X_WP) noexcept {
  if (known()) {
    const Vector3d hand_m = X_WP.translation_m - X_WP_.translation_m;
    const Vector3d hand_turn = small_rotation_vector(X_WP_.rotation.conjugate() * X_WP.rotation);
    const Vector3d tool_m = X_WT.translation_m - X_WT_.translation_m;
    const Vector3d tool_turn_W = small_rotation_vector(X_WT.rotation * X_WT_.rotation.conjugate());
    const double newest = std::max(kNewest, 1.0 / learned_);
    const Vector3d faster_m = newest * (hand_m - shift_m_), faster = newest * (hand_turn - turn_);
    shift_m_ += faster_m;
    turn_ += faster;
    if (learned_ > 1.0) {
      shift_more_m_ += kNewestMore * (faster_m - shift_more_m_);
      turn_more_ += kNewestMore * (faster - turn_more_);
    }
    drift_m_ += kNewestDrift * (tool_m - hand_m - drift_m_);
    drift_turn_ += kNewestDrift * (tool_turn_W - X_WP.rotation * hand_turn - drift_turn_);
  }
  ++learned_;
  X_WT_ = X_WT;
  X_WP_ = X_WP;
}

Pose ExpectedMotion::after(double ticks) const noexcept {
  const double late = (1.0 - kNewest) / kNewest;  // ticks by which what is smoothed lags
  const double more = ticks * (0.5 * ticks + late);
  return {
      (rotation_from(ticks * drift_turn_) * X_WT_.rotation * rotation_from(ticks * turn_ + more * turn_more_))
          .normalized(),
      X_WT_.translation_m + ticks * (shift_m_ + drift_m_) + more * shift_more_m_};
}

/// A parabola leaves its chord by an eighth of a t^2.
double ExpectedMotion::bend_m(double ticks, double radius_m) const noexcept {
  return ticks * ticks / 8.0 * (shift_more_m_.norm() + radius_m * turn_more_.norm());
}

}  // namespace wrenchd
