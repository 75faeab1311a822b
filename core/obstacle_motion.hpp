// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/pose.hpp"

namespace wrenchd {

/// The law by which an obstacle moves: at constant velocity, for ever, for a while, or to and fro.
///
///   X_WO(t) = [ exp(w^ s(t)) R_WO(0)   p_WO(0) + v s(t) ]        s: time on the way, |ds/dt| = 1 or 0
///
/// s = t - begin, or, where it turns back, a triangle wave of that: so long one way, then back, and again. A
/// pose depends on t alone, so whoever asks for the same time gets the same bits.
struct ObstacleMotion {
  /// A pose after longer than this [s] is that of this time: 30 years, and nothing overflows.
  static constexpr double kMaxTime_s = 1e9;
  /// What a scene may ask for; at() itself takes any finite velocity that keeps kLongest_s times it finite.
  static constexpr double kMaxSpeed_m_per_s = 5.0;
  static constexpr double kMaxAngularSpeed_rad_per_s = 50.0;

  Vector3d linear_m_per_s = Vector3d::Zero();     ///< v: of O's origin, in W
  Vector3d angular_rad_per_s = Vector3d::Zero();  ///< w: in W, about O's own origin
  double reverse_after_s = 0.0;                   ///< turns back each time after so long; 0: never
  double start_s = 0.0;                           ///< scene time at which it sets out
  double duration_s = 0.0;                        ///< stands again after so long; 0: never

  bool moves() const noexcept { return !linear_m_per_s.isZero(0.0) || !angular_rad_per_s.isZero(0.0); }

  /// From one pose to another along the straight way, turning about one axis: it sets out at begin_s and is
  /// there, but for rounding, over_s later (above 0).
  static ObstacleMotion between(const Pose& X_from, const Pose& X_to, double begin_s, double over_s) noexcept;

  /// X_WO at scene time t_s [s], from X_WO_0, that until it sets out. Exactly X_WO_0 until then, for a NaN,
  /// and where nothing moves; finite for every t. RT safe.
  Pose pose_at(const Pose& X_WO_0, double t_s) const noexcept;

 private:
  double path_time_s(double t_s) const noexcept;
};

/// What an obstacle does from some scene time on, in the place of what it did until then.
struct ScheduledMotion {
  double start_s = 0.0;
  Pose X_WO;  ///< at that time
  ObstacleMotion motion;
};

}  // namespace wrenchd
