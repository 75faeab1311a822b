// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/deflection_pose.hpp"

#include <algorithm>
#include <cmath>

namespace wrenchd {
namespace {

/// Of the greatest speed: what a hand that steers takes for none.
constexpr double kNoSpeed = 1e-4;
/// Rounding, and the clearance that the proxy keeps: nothing to take in.
constexpr double kNoWay_m = 1e-7;
constexpr double kNoTurn_rad = 1e-6;

Vector3d no_longer_than(const Vector3d& v, double most) noexcept {
  const double length = v.norm();
  return length <= most ? v : Vector3d(v * (most / length));
}

/// The share of a push t that goes the way w.
double restrict_to_dofs(const Vector3d& t, const Vector3d& w) noexcept {
  const double lengths = t.norm() * w.norm();
  return lengths > 0.0 ? std::max(t.dot(w) / lengths, 0.0) : 0.0;
}

/// How far to go back along a way of this length.
double excess(double length, double leash, double nothing) noexcept {
  return length - leash > nothing ? length - leash : 0.0;
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
  const double firmness = std::min(speed / (gain_ * full_scale_), 1.0);
  if (!(firmness > kNoSpeed)) return Vector3d::Zero();
  const double share = dead_zone_ + (1.0 - dead_zone_) * std::pow(firmness, 1.0 / exponent_);
  return full_scale_ * share / speed * v;
}

/// The velocity that the cap asks for. In position mode: what brings the pose to its goal within this step.
Twist DeflectionPose::commanded_twist(double dt_s) const noexcept {
  if (settings_.mode == Deflection::Mode::rate)
    return {speed_factor_ * linear_.velocity(translation_m_), speed_factor_ * angular_.velocity(rotation_rad_)};
  const Vector3d goal = no_longer_than(settings_.linear_gain * translation_m_, settings_.reach_m);
  return {
      (goal - X_BH_.translation_m) / dt_s,
      rotation_vector(rotation_from(settings_.angular_gain * rotation_rad_) * X_BH_.rotation.conjugate()) /
          dt_s};
}

void DeflectionPose::advance(double dt_s) noexcept {
  if (!(dt_s > 0.0)) return;
  const Pose before = X_BH_;
  const Twist V = commanded_twist(dt_s);
  V_BH_.linear_m_per_s = no_longer_than(V.linear_m_per_s, max_linear_m_per_s_);
  V_BH_.angular_rad_per_s = no_longer_than(V.angular_rad_per_s, max_angular_rad_per_s_);
  X_BH_.translation_m += dt_s * V_BH_.linear_m_per_s;
  X_BH_.rotation = (rotation_from(dt_s * V_BH_.angular_rad_per_s) * X_BH_.rotation).normalized();
  if (X_BQ_ && settings_.has_proxy_distance_limit()) limit_lead(before, dt_s);
  clamp_to_workspace(before, dt_s);
}

/// The leash. What is too far is asked of the pose that the world has answered, the one before this step: the
/// step itself is not in anybody's way yet. It comes in as fast as the profile's speeds allow beside the
/// step.
void DeflectionPose::limit_lead(const Pose& before, double dt_s) noexcept {
  const Vector3d way = before.translation_m - X_BQ_->translation_m;
  const Vector3d turn = rotation_vector(before.rotation * X_BQ_->rotation.conjugate());
  const double firmness = std::max(linear_.response(translation_m_) * restrict_to_dofs(translation_m_, way),
                                   angular_.response(rotation_rad_) * restrict_to_dofs(rotation_rad_, turn));
  const double back_m = excess(way.norm(), firmness * settings_.max_proxy_distance_m, kNoWay_m);
  if (back_m > 0.0) {
    X_BH_.translation_m -= back_m * way.normalized();
    const Vector3d step =
        no_longer_than(X_BH_.translation_m - before.translation_m, dt_s * max_linear_m_per_s_);
    X_BH_.translation_m = before.translation_m + step;
    V_BH_.linear_m_per_s = step / dt_s;
  }
  const double back_rad = excess(turn.norm(), firmness * settings_.max_proxy_angle_rad, kNoTurn_rad);
  if (back_rad > 0.0) {
    X_BH_.rotation = (rotation_from(-back_rad * turn.normalized()) * X_BH_.rotation).normalized();
    const Vector3d step = no_longer_than(rotation_vector(X_BH_.rotation * before.rotation.conjugate()),
                                         dt_s * max_angular_rad_per_s_);
    X_BH_.rotation = (rotation_from(step) * before.rotation).normalized();
    V_BH_.angular_rad_per_s = step / dt_s;
  }
}

void DeflectionPose::clamp_to_workspace(const Pose& before, double dt_s) noexcept {
  const Vector3d& p = X_BH_.translation_m;
  const Vector3d within =
      no_longer_than(p, settings_.reach_m).cwiseMax(settings_.box_min_m).cwiseMin(settings_.box_max_m);
  if (within == p) return;
  X_BH_.translation_m = within;
  V_BH_.linear_m_per_s = (within - before.translation_m) / dt_s;
}

}  // namespace wrenchd
