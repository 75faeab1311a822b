// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/pose.hpp"

namespace wrenchd {

/// The law by which an obstacle moves: at constant velocity, for ever or to and fro.
///
///   X_WO(t) = [ exp(w^ s(t)) R_WO(0)   p_WO(0) + v s(t) ]        s: time on the way, |ds/dt| = 1
///
/// s = t, or, where it turns back, a triangle wave of time: so long one way, then back, and again. A pose
/// depends on t alone, so whoever asks for the same time gets the same bits.
struct ObstacleMotion {
  /// A pose after longer than this [s] is that of this time: 30 years, and nothing overflows.
  static constexpr double kLongest_s = 1e9;
  /// What a scene may ask for; at() itself takes any finite velocity that keeps kLongest_s times it finite.
  static constexpr double kMaxSpeed_m_per_s = 5.0;
  static constexpr double kMaxAngularSpeed_rad_per_s = 50.0;

  Vector3d linear_m_per_s = Vector3d::Zero();     ///< v: of O's origin, in W
  Vector3d angular_rad_per_s = Vector3d::Zero();  ///< w: in W, about O's own origin
  double turn_back_s = 0.0;                       ///< turns back each time after so long; 0: never

  bool moves() const noexcept { return !linear_m_per_s.isZero(0.0) || !angular_rad_per_s.isZero(0.0); }

  /// X_WO at scene time t_s [s], from X_WO_0, that at time 0. Exactly X_WO_0 at t <= 0, for a NaN, and where
  /// nothing moves; finite for every t. RT safe.
  Pose at(const Pose& X_WO_0, double t_s) const noexcept;

 private:
  double on_the_way_s(double t_s) const noexcept;
};

}  // namespace wrenchd
