// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/pairs/motion_predictor.hpp"

#include <algorithm>

namespace wrenchd {
namespace {

/// Weight of the newest tick in the running means: of the hand's velocity (at least), of its acceleration, of
/// the drift.
constexpr double kMinVelocityWeight = 0.3;
constexpr double kAccelerationWeight = 0.1;
constexpr double kDriftWeight = 0.1;

}  // namespace

void MotionPredictor::observe_deferred(const Pose& X_WP) noexcept {
  if (!has_observation()) return;
  const Vector3d hand_rotation = small_rotation_vector(X_WP_.rotation.conjugate() * X_WP.rotation);
  const Pose X_WT = {
      (rotation_from(drift_rad_per_tick_) * X_WT_.rotation * rotation_from(hand_rotation)).normalized(),
      X_WT_.translation_m + X_WP.translation_m - X_WP_.translation_m + drift_m_per_tick_};
  observe(X_WT, X_WP);
}

void MotionPredictor::observe(const Pose& X_WT, const Pose& X_WP) noexcept {
  if (has_observation()) {
    const Vector3d hand_m = X_WP.translation_m - X_WP_.translation_m;
    const Vector3d hand_rotation = small_rotation_vector(X_WP_.rotation.conjugate() * X_WP.rotation);
    const Vector3d tool_m = X_WT.translation_m - X_WT_.translation_m;
    const Vector3d tool_rotation_W = small_rotation_vector(X_WT.rotation * X_WT_.rotation.conjugate());
    const double weight = std::max(kMinVelocityWeight, 1.0 / observations_);
    const Vector3d velocity_change_m = weight * (hand_m - hand_velocity_m_per_tick_),
                   velocity_change_rad = weight * (hand_rotation - hand_velocity_rad_per_tick_);
    hand_velocity_m_per_tick_ += velocity_change_m;
    hand_velocity_rad_per_tick_ += velocity_change_rad;
    if (observations_ > 1.0) {
      hand_acceleration_m_per_tick2_ +=
          kAccelerationWeight * (velocity_change_m - hand_acceleration_m_per_tick2_);
      hand_acceleration_rad_per_tick2_ +=
          kAccelerationWeight * (velocity_change_rad - hand_acceleration_rad_per_tick2_);
    }
    drift_m_per_tick_ += kDriftWeight * (tool_m - hand_m - drift_m_per_tick_);
    drift_rad_per_tick_ +=
        kDriftWeight * (tool_rotation_W - X_WP.rotation * hand_rotation - drift_rad_per_tick_);
  }
  ++observations_;
  X_WT_ = X_WT;
  X_WP_ = X_WP;
}

Pose MotionPredictor::predict(double ticks) const noexcept {
  const double lag_ticks =
      (1.0 - kMinVelocityWeight) / kMinVelocityWeight;  // lag of the smoothed velocity [ticks]
  const double acceleration_factor = ticks * (0.5 * ticks + lag_ticks);
  return {(rotation_from(ticks * drift_rad_per_tick_) * X_WT_.rotation *
           rotation_from(ticks * hand_velocity_rad_per_tick_ +
                         acceleration_factor * hand_acceleration_rad_per_tick2_))
              .normalized(),
          X_WT_.translation_m + ticks * (hand_velocity_m_per_tick_ + drift_m_per_tick_) +
              acceleration_factor * hand_acceleration_m_per_tick2_};
}

/// A parabola with acceleration a deviates from its chord by a t^2 / 8.
double MotionPredictor::chord_deviation_m(double ticks, double radius_m) const noexcept {
  return ticks * ticks / 8.0 *
         (hand_acceleration_m_per_tick2_.norm() + radius_m * hand_acceleration_rad_per_tick2_.norm());
}

}  // namespace wrenchd
