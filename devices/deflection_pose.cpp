// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/deflection_pose.hpp"

namespace wrenchd {
namespace {

Vector3d no_longer_than(const Vector3d& v, double most) noexcept {
  const double length = v.norm();
  return length <= most ? v : Vector3d(v * (most / length));
}

}  // namespace

/// The velocity that the cap asks for. In position mode: what brings the pose to its goal within this step.
Twist DeflectionPose::wanted(double dt_s) const noexcept {
  const Vector3d linear = settings_.linear_gain * translation_m_;
  const Vector3d angular = settings_.angular_gain * rotation_rad_;
  if (settings_.mode == Deflection::Mode::rate) return {linear, angular};
  const Vector3d goal = no_longer_than(linear, settings_.reach_m);
  return {(goal - X_BH_.translation_m) / dt_s,
          rotation_vector(rotation_from(angular) * X_BH_.rotation.conjugate()) / dt_s};
}

void DeflectionPose::advance(double dt_s) noexcept {
  if (!(dt_s > 0.0)) return;
  const Twist V = wanted(dt_s);
  V_BH_.linear_m_per_s = no_longer_than(V.linear_m_per_s, max_linear_m_per_s_);
  V_BH_.angular_rad_per_s = no_longer_than(V.angular_rad_per_s, max_angular_rad_per_s_);
  const Vector3d p = X_BH_.translation_m + dt_s * V_BH_.linear_m_per_s;
  const Vector3d within = no_longer_than(p, settings_.reach_m);
  if (within != p) V_BH_.linear_m_per_s = (within - X_BH_.translation_m) / dt_s;
  X_BH_.translation_m = within;
  X_BH_.rotation = (rotation_from(dt_s * V_BH_.angular_rad_per_s) * X_BH_.rotation).normalized();
}

}  // namespace wrenchd
