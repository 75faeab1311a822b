// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/pose.hpp"

namespace wrenchd {

/// Motion of an obstacle at constant velocity: unlimited, for a limited time, or back and forth, METHOD (96).
///
///   X_WO(t) = [ exp(w^ s(t)) R_WO(0)   p_WO(0) + v s(t) ]        s: path time, |ds/dt| = 1 or 0
///
/// s = t - start, or with reversals the triangle wave of t - start. The pose depends on t only: equal times
/// give equal bits.
struct ObstacleMotion {
  /// Upper limit of the path time, about 30 years. It prevents overflow.
  static constexpr double kMaxTime_s = 1e9;
  /// Limits for scenes. pose_at() accepts any velocity whose product with kMaxTime_s is finite.
  static constexpr double kMaxSpeed_m_per_s = 5.0;
  static constexpr double kMaxAngularSpeed_rad_per_s = 50.0;

  Vector3d linear_m_per_s = Vector3d::Zero();     ///< v: velocity of the origin of O, in W
  Vector3d angular_rad_per_s = Vector3d::Zero();  ///< w: angular velocity in W, about the origin of O
  double reverse_after_s = 0.0;  ///< time between two reversals of the direction; 0: no reversal
  double start_s = 0.0;          ///< scene time at which the motion starts
  double duration_s = 0.0;       ///< time after which the motion ends; 0: no end

  bool moves() const noexcept { return !linear_m_per_s.isZero(0.0) || !angular_rad_per_s.isZero(0.0); }

  /// Motion along the straight line between two poses, with rotation about one axis. It starts at begin_s and
  /// ends, up to rounding, over_s (> 0) later.
  static ObstacleMotion between(const Pose& X_from, const Pose& X_to, double begin_s, double over_s) noexcept;

  /// X_WO at the scene time t_s [s]. X_WO_0: pose before the start. Returns X_WO_0 bit for bit before the
  /// start, for t_s = NaN, and without velocity. Finite for every t_s. RT-safe.
  Pose pose_at(const Pose& X_WO_0, double t_s) const noexcept;

 private:
  double path_time_s(double t_s) const noexcept;
};

/// A motion that replaces the previous motion of an obstacle from a scene time on.
struct ScheduledMotion {
  double start_s = 0.0;
  Pose X_WO;  ///< pose of the obstacle at start_s
  ObstacleMotion motion;
};

}  // namespace wrenchd
