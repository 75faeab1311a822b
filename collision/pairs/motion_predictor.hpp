// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/pose.hpp"

namespace wrenchd {

/// Predicts the pose of a tool that follows a hand. The prediction moves the tool with the hand's smoothed
/// velocity and acceleration. To this it adds the smoothed drift between tool and hand. The hand moves
/// smoothly, whereas the tool's own path has kinks where contacts begin and end. All members are RT-safe.
class MotionPredictor {
 public:
  /// Updates the estimates; call it once per tick with the tool pose X_WT and the commanded pose X_WP.
  /// RT-safe.
  void observe(const Pose& X_WT, const Pose& X_WP) noexcept;
  /// Replaces observe() in a tick that deferred work. The tool's position is then no information about its
  /// motion, so the tool is assumed at its predicted pose. RT-safe.
  void observe_deferred(const Pose& X_WP) noexcept;
  /// Discards all estimates, for example after the tool was placed elsewhere. RT-safe.
  void reset() noexcept { *this = MotionPredictor(); }

  bool has_observation() const noexcept { return observations_ > 0.0; }

  /// Returns the predicted tool pose `ticks` from now. Precondition: has_observation(). RT-safe.
  Pose predict(double ticks) const noexcept;
  /// Returns the deviation of the predicted path from its chord, for a point at radius_m from the tool's
  /// origin [m]. RT-safe.
  double chord_deviation_m(double ticks, double radius_m) const noexcept;

 private:
  double observations_ = 0.0;  ///< number of observed ticks
  Pose X_WT_, X_WP_;           ///< poses of the last tick
  // Motion per tick. Rotations of the hand are in its own frame, rotations of the drift are in W.
  Vector3d hand_velocity_m_per_tick_ = Vector3d::Zero(), hand_velocity_rad_per_tick_ = Vector3d::Zero();
  Vector3d hand_acceleration_m_per_tick2_ = Vector3d::Zero(),
           hand_acceleration_rad_per_tick2_ = Vector3d::Zero();
  Vector3d drift_m_per_tick_ = Vector3d::Zero(), drift_rad_per_tick_ = Vector3d::Zero();
};

}  // namespace wrenchd
