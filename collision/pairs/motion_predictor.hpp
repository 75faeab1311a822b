// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/pose.hpp"

namespace wrenchd {

/// Where a tool will be that follows a hand: as far from it as it is now, and drifting from there as it did
/// of late. The hand moves smoothly; the tool's own way jumps about where contacts come and go.
class MotionPredictor {
 public:
  /// Once a tick: the tool has come to X_WT and the hand to X_WP. RT safe.
  void observe(const Pose& X_WT, const Pose& X_WP) noexcept;
  /// The same where the tool is late: it is where it is for no reason of its own, and expected where it would
  /// have come to. RT safe.
  void observe_deferred(const Pose& X_WP) noexcept;
  /// They are elsewhere now, and how they moved says nothing about how they will. RT safe.
  void reset() noexcept { *this = MotionPredictor(); }

  bool has_observation() const noexcept { return observations_ > 0.0; }

  /// The tool's pose so many ticks from now. At least one must have been learned. RT safe.
  Pose predict(double ticks) const noexcept;
  /// By how much the way there leaves the straight one, for a point so far from the tool's origin [m].
  double chord_deviation_m(double ticks, double radius_m) const noexcept;

 private:
  double observations_ = 0.0;  ///< ticks
  Pose X_WT_, X_WP_;           ///< of the last one
  // Per tick. The hand's turns in its own frame, those of the drift in the world's.
  Vector3d hand_velocity_m_per_tick_ = Vector3d::Zero(), hand_velocity_rad_per_tick_ = Vector3d::Zero();
  Vector3d hand_acceleration_m_per_tick2_ = Vector3d::Zero(),
           hand_acceleration_rad_per_tick2_ = Vector3d::Zero();  ///< by which they grow per tick
  Vector3d drift_m_per_tick_ = Vector3d::Zero(), drift_rad_per_tick_ = Vector3d::Zero();
};

}  // namespace wrenchd
