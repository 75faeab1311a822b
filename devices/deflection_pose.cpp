// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/deflection_pose.hpp"

#include <algorithm>
#include <cmath>

#include "devices/clamp_norm.hpp"

namespace wrenchd {
namespace {

/// Share of the maximum speed below which the inverse response returns zero.
constexpr double kMinResponse = 1e-4;
/// Tolerances for rounding and for the clearance of the proxy. Smaller distances are not corrected.
constexpr double kDistanceTolerance_m = 1e-7;
constexpr double kRoundingAngle_rad = 1e-6;

/// Returns the cosine between a deflection and an offset, clamped to 0 .. 1.
double alignment(const Vector3d& t, const Vector3d& w) noexcept {
  const double lengths = t.norm() * w.norm();
  return lengths > 0.0 ? std::max(t.dot(w) / lengths, 0.0) : 0.0;
}

/// Returns how far a length exceeds its limit; 0 within the tolerance.
double excess(double length, double limit, double tolerance) noexcept {
  return length - limit > tolerance ? length - limit : 0.0;
}

}  // namespace

double SteeringCurve::response(const Vector3d& t) const noexcept {
  if (!has_full_scale()) return 0.0;
  const double share = (t.norm() / full_scale_ - dead_zone_) / (1.0 - dead_zone_);
  return std::pow(std::clamp(share, 0.0, 1.0), exponent_);
}

Vector3d SteeringCurve::velocity(const Vector3d& t) const noexcept {
  if (!has_full_scale()) return gain_ * t;
  const double length = t.norm();
  return length > 0.0 ? Vector3d(gain_ * full_scale_ * response(t) / length * t) : Vector3d(Vector3d::Zero());
}

Vector3d SteeringCurve::deflection(const Vector3d& v) const noexcept {
  if (!has_full_scale()) return v / gain_;
  const double speed = v.norm();
  const double scale = std::min(speed / (gain_ * full_scale_), 1.0);
  if (!(scale > kMinResponse)) return Vector3d::Zero();
  const double share = dead_zone_ + (1.0 - dead_zone_) * std::pow(scale, 1.0 / exponent_);
  return full_scale_ * share / speed * v;
}

/// Twist commanded by the puck. In position mode: the twist that reaches the goal within this step.
Twist DeflectionPose::commanded_twist(double dt_s) const noexcept {
  if (settings_.mode == Deflection::Mode::rate)
    return {speed_factor_ * linear_.velocity(translation_m_),
            speed_factor_ * angular_.velocity(rotation_rad_)};
  const Vector3d goal = clamp_norm(settings_.linear_gain * translation_m_, settings_.reach_m);
  return {
      (goal - X_BH_.translation_m) / dt_s,
      rotation_vector(rotation_from(settings_.angular_gain * rotation_rad_) * X_BH_.rotation.conjugate()) /
          dt_s};
}

void DeflectionPose::advance(double dt_s) noexcept {
  if (!(dt_s > 0.0)) return;
  const Pose before = X_BH_;
  const Twist V = commanded_twist(dt_s);
  V_BH_.linear_m_per_s = clamp_norm(V.linear_m_per_s, max_linear_m_per_s_);
  V_BH_.angular_rad_per_s = clamp_norm(V.angular_rad_per_s, max_angular_rad_per_s_);
  X_BH_.translation_m += dt_s * V_BH_.linear_m_per_s;
  X_BH_.rotation = (rotation_from(dt_s * V_BH_.angular_rad_per_s) * X_BH_.rotation).normalized();
  if (X_BQ_ && settings_.has_proxy_distance_limit()) limit_proxy_distance(before, dt_s);
  clamp_to_workspace(before, dt_s);
}

/// Limits the distance to the proxy. The limit applies to the pose before this step, because the proxy has
/// not yet responded to the step itself. The pose returns at most at the speed limits of the profile,
/// including the step.
void DeflectionPose::limit_proxy_distance(const Pose& before, double dt_s) noexcept {
  const Vector3d offset = before.translation_m - X_BQ_->translation_m;
  const Vector3d rotation = rotation_vector(before.rotation * X_BQ_->rotation.conjugate());
  const double scale = std::max(linear_.response(translation_m_) * alignment(translation_m_, offset),
                                angular_.response(rotation_rad_) * alignment(rotation_rad_, rotation));
  const double excess_m = excess(offset.norm(), scale * settings_.max_proxy_distance_m, kDistanceTolerance_m);
  if (excess_m > 0.0) {
    X_BH_.translation_m -= excess_m * offset.normalized();
    const Vector3d step = clamp_norm(X_BH_.translation_m - before.translation_m, dt_s * max_linear_m_per_s_);
    X_BH_.translation_m = before.translation_m + step;
    V_BH_.linear_m_per_s = step / dt_s;
  }
  const double excess_rad =
      excess(rotation.norm(), scale * settings_.max_proxy_angle_rad, kRoundingAngle_rad);
  if (excess_rad > 0.0) {
    X_BH_.rotation = (rotation_from(-excess_rad * rotation.normalized()) * X_BH_.rotation).normalized();
    const Vector3d step = clamp_norm(rotation_vector(X_BH_.rotation * before.rotation.conjugate()),
                                     dt_s * max_angular_rad_per_s_);
    X_BH_.rotation = (rotation_from(step) * before.rotation).normalized();
    V_BH_.angular_rad_per_s = step / dt_s;
  }
}

void DeflectionPose::clamp_to_workspace(const Pose& before, double dt_s) noexcept {
  const Vector3d& p = X_BH_.translation_m;
  const Vector3d within =
      clamp_norm(p, settings_.reach_m).cwiseMax(settings_.box_min_m).cwiseMin(settings_.box_max_m);
  if (within == p) return;
  X_BH_.translation_m = within;
  V_BH_.linear_m_per_s = (within - before.translation_m) / dt_s;
}

}  // namespace wrenchd
