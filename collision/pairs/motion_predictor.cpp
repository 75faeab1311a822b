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

void MotionPredictor::observe_deferred(const Pose& X_WP) noexcept {
  if (!has_observation()) return;
  const Vector3d hand_turn = small_rotation_vector(X_WP_.rotation.conjugate() * X_WP.rotation);
  const Pose X_WT = {
      (rotation_from(drift_rad_per_tick_) * X_WT_.rotation * rotation_from(hand_turn)).normalized(),
      X_WT_.translation_m + X_WP.translation_m - X_WP_.translation_m + drift_m_per_tick_};
  observe(X_WT, X_WP);
}

void MotionPredictor::observe(const Pose& X_WT, const Pose& X_WP) noexcept {
  if (has_observation()) {
    const Vector3d hand_m = X_WP.translation_m - X_WP_.translation_m;
    const Vector3d hand_turn = small_rotation_vector(X_WP_.rotation.conjugate() * X_WP.rotation);
    const Vector3d tool_m = X_WT.translation_m - X_WT_.translation_m;
    const Vector3d tool_turn_W = small_rotation_vector(X_WT.rotation * X_WT_.rotation.conjugate());
    const double newest = std::max(kNewest, 1.0 / observations_);
    const Vector3d faster_m = newest * (hand_m - hand_velocity_m_per_tick_),
                   faster = newest * (hand_turn - hand_velocity_rad_per_tick_);
    hand_velocity_m_per_tick_ += faster_m;
    hand_velocity_rad_per_tick_ += faster;
    if (observations_ > 1.0) {
      hand_acceleration_m_per_tick2_ += kNewestMore * (faster_m - hand_acceleration_m_per_tick2_);
      hand_acceleration_rad_per_tick2_ += kNewestMore * (faster - hand_acceleration_rad_per_tick2_);
    }
    drift_m_per_tick_ += kNewestDrift * (tool_m - hand_m - drift_m_per_tick_);
    drift_rad_per_tick_ += kNewestDrift * (tool_turn_W - X_WP.rotation * hand_turn - drift_rad_per_tick_);
  }
  ++observations_;
  X_WT_ = X_WT;
  X_WP_ = X_WP;
}

Pose MotionPredictor::predict(double ticks) const noexcept {
  const double late = (1.0 - kNewest) / kNewest;  // ticks by which what is smoothed lags
  const double more = ticks * (0.5 * ticks + late);
  return {(rotation_from(ticks * drift_rad_per_tick_) * X_WT_.rotation *
           rotation_from(ticks * hand_velocity_rad_per_tick_ + more * hand_acceleration_rad_per_tick2_))
              .normalized(),
          X_WT_.translation_m + ticks * (hand_velocity_m_per_tick_ + drift_m_per_tick_) +
              more * hand_acceleration_m_per_tick2_};
}

/// A parabola leaves its chord by an eighth of a t^2.
double MotionPredictor::chord_deviation_m(double ticks, double radius_m) const noexcept {
  return ticks * ticks / 8.0 *
         (hand_acceleration_m_per_tick2_.norm() + radius_m * hand_acceleration_rad_per_tick2_.norm());
}

}  // namespace wrenchd
