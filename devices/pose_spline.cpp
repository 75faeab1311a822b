// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/pose_spline.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "core/finite.hpp"

namespace wrenchd {
namespace {

/// Below this angle the series of the Jacobians are exact to double precision.
constexpr double kSmall_rad = 1e-4;

[[noreturn]] void reject_pose(std::size_t i, const std::string& what) {
  throw std::invalid_argument("pose " + std::to_string(i + 1) + " of the recorded path: " + what);
}

/// Right Jacobian of exp on SO(3), and its inverse: exp(phi + d) = exp(phi) exp(Jr(phi) d) to first order
/// (Sola, Deray and Atchuthan 2018, Eqs. 143, 144).
Matrix3d right_jacobian(const Vector3d& phi) noexcept {
  const double angle = phi.norm();
  const Matrix3d h = hat(phi);
  if (angle < kSmall_rad) return Matrix3d::Identity() - 0.5 * h + h * h / 6.0;
  const double a2 = angle * angle;
  return Matrix3d::Identity() - (1.0 - std::cos(angle)) / a2 * h +
         (angle - std::sin(angle)) / (a2 * angle) * h * h;
}

Matrix3d inverse_right_jacobian(const Vector3d& phi) noexcept {
  const double angle = phi.norm();
  const Matrix3d h = hat(phi);
  if (angle < kSmall_rad) return Matrix3d::Identity() + 0.5 * h + h * h / 12.0;
  const double a2 = angle * angle;
  return Matrix3d::Identity() + 0.5 * h +
         (1.0 / a2 - (1.0 + std::cos(angle)) / (2.0 * angle * std::sin(angle))) * h * h;
}

/// H and its derivative with respect to u, from 0 with slope m0 to `end` with slope m1.
struct Hermite {
  Vector3d value, slope;
};
Hermite hermite(double u, const Vector3d& m0, const Vector3d& end, const Vector3d& m1) noexcept {
  const double u2 = u * u, u3 = u2 * u;
  return {(u3 - 2.0 * u2 + u) * m0 + (3.0 * u2 - 2.0 * u3) * end + (u3 - u2) * m1,
          (3.0 * u2 - 4.0 * u + 1.0) * m0 + (6.0 * u - 6.0 * u2) * end + (3.0 * u2 - 2.0 * u) * m1};
}

}  // namespace

PoseSpline::PoseSpline(const std::vector<TimedPose>& poses) {
  if (poses.empty()) throw std::invalid_argument("the recorded path has no pose");
  if (poses.front().time_s != 0.0) reject_pose(0, "it is not at time 0");
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const auto& [time_s, X] = poses[i];
    if (!is_finite(time_s) || !is_finite(X)) reject_pose(i, "a number is not finite");
    if (i > 0 && !(time_s > poses[i - 1].time_s)) reject_pose(i, "times must rise");
    knots_.push_back({time_s, X, Vector3d::Zero(), Vector3d::Zero(), Vector3d::Zero()});
  }
  for (std::size_t i = 0; i + 1 < knots_.size(); ++i) {
    knots_[i].rotation_rad =
        rotation_vector(knots_[i].X_BG.rotation.conjugate() * knots_[i + 1].X_BG.rotation);
    if (knots_[i].rotation_rad.norm() > kMaxRotation_rad)
      reject_pose(i + 1, "its rotation from the previous pose is too large to be unambiguous");
  }
  // Mean over both intervals. The axis of a rotation is the same in its start and end frame, so both vectors
  // are in axes of G.
  for (std::size_t i = 1; i + 1 < knots_.size(); ++i) {
    const double span_s = knots_[i + 1].time_s - knots_[i - 1].time_s;
    knots_[i].v_m_per_s = (knots_[i + 1].X_BG.translation_m - knots_[i - 1].X_BG.translation_m) / span_s;
    knots_[i].w_rad_per_s = (knots_[i - 1].rotation_rad + knots_[i].rotation_rad) / span_s;
  }
}

HandTarget PoseSpline::at(Duration since_start) const noexcept {
  const double t_s = std::max(seconds(since_start), 0.0);
  const auto next = std::upper_bound(knots_.begin(), knots_.end(), t_s,
                                     [](double time_s, const Knot& k) { return time_s < k.time_s; });
  if (next == knots_.end()) return {knots_.back().X_BG, {}};
  const Knot& from = *std::prev(next);
  const double h_s = next->time_s - from.time_s;
  const double u = (t_s - from.time_s) / h_s;
  const Hermite p = hermite(u, h_s * from.v_m_per_s, next->X_BG.translation_m - from.X_BG.translation_m,
                            h_s * next->v_m_per_s);
  const Hermite phi = hermite(u, h_s * from.w_rad_per_s, from.rotation_rad,
                              h_s * (inverse_right_jacobian(from.rotation_rad) * next->w_rad_per_s));
  const Quaterniond R = (from.X_BG.rotation * rotation_from(phi.value)).normalized();
  return {{R, from.X_BG.translation_m + p.value},
          {p.slope / h_s, R * (right_jacobian(phi.value) * phi.slope / h_s)}};
}

}  // namespace wrenchd
