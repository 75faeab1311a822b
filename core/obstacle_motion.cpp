// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/obstacle_motion.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace wrenchd {

ObstacleMotion ObstacleMotion::between(const Pose& X_from, const Pose& X_to, double begin_s,
                                       double over_s) noexcept {
  ObstacleMotion motion;
  motion.linear_m_per_s = (X_to.translation_m - X_from.translation_m) / over_s;
  motion.angular_rad_per_s = rotation_vector(X_to.rotation * X_from.rotation.conjugate()) / over_s;
  motion.start_s = begin_s;
  motion.duration_s = over_s;
  return motion;
}

Pose ObstacleMotion::pose_at(const Pose& X_WO_0, double t_s) const noexcept {
  const double s = path_time_s(t_s);
  if (!(s > 0.0)) return X_WO_0;
  Pose X_WO = X_WO_0;
  if (!linear_m_per_s.isZero(0.0)) X_WO.translation_m += s * linear_m_per_s;
  const double speed = angular_rad_per_s.norm();
  if (speed == 0.0) return X_WO;
  // Removes whole turns, which would cost the angle its digits; two at a time, because a unit quaternion
  // returns to itself, and not to its negative, after two turns.
  const double angle_time_s = std::fmod(s, 4.0 * std::numbers::pi / speed);
  X_WO.rotation = (rotation_from(angle_time_s * angular_rad_per_s) * X_WO_0.rotation).normalized();
  return X_WO;
}

/// s(t) of METHOD (96). fmod() is exact, so the reversals keep their times for days.
double ObstacleMotion::path_time_s(double t_s) const noexcept {
  const double elapsed_s = t_s - start_s;
  if (!(elapsed_s > 0.0)) return 0.0;
  const double t = std::min(elapsed_s, duration_s > 0.0 ? duration_s : kMaxTime_s);
  if (!(reverse_after_s > 0.0)) return t;
  const double in_period_s = std::fmod(t, 2.0 * reverse_after_s);
  return std::min(in_period_s, 2.0 * reverse_after_s - in_period_s);
}

}  // namespace wrenchd
