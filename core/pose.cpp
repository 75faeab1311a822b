// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/pose.hpp"

#include <cmath>

namespace wrenchd {
namespace {

/// Below this angle [rad] the series of the quotients of sin and cos are exact to double precision: the first
/// omitted term, theta^4 / 120, is 1e-18.
constexpr double kSmallAngle_rad = 1e-4;

/// b = (1 - cos t)/t^2 and c = (t - sin t)/t^3 of the left Jacobian of SO(3).
struct JacobianTerms {
  double b;
  double c;
};

JacobianTerms jacobian_terms(double theta) noexcept {
  const double t2 = theta * theta;
  if (theta < kSmallAngle_rad) return {0.5 - t2 / 24.0, 1.0 / 6.0 - t2 / 120.0};
  const double s = std::sin(0.5 * theta);  // 1 - cos t = 2 sin^2(t/2) keeps its digits for small t
  return {2.0 * s * s / t2, (theta - std::sin(theta)) / (t2 * theta)};
}

}  // namespace

Pose operator*(const Pose& X_AB, const Pose& X_BC) noexcept {
  return {(X_AB.rotation * X_BC.rotation).normalized(), X_AB * X_BC.translation_m};
}

Pose inverse(const Pose& X_AB) noexcept {
  const Quaterniond R_BA = X_AB.rotation.conjugate();
  return {R_BA, -(R_BA * X_AB.translation_m)};
}

Quaterniond rotation_from(const Vector3d& w) noexcept {
  const double theta = w.norm();
  const double half_sinc =
      theta < kSmallAngle_rad ? 0.5 - theta * theta / 48.0 : std::sin(0.5 * theta) / theta;
  Quaterniond q;
  q.w() = std::cos(0.5 * theta);
  q.vec() = half_sinc * w;
  return q.normalized();
}

Vector3d rotation_vector(const Quaterniond& R) noexcept {
  const double sign = R.w() < 0.0 ? -1.0 : 1.0;
  const Vector3d v = sign * R.vec();
  const double n = v.norm();  // sin(theta/2)
  const double theta = 2.0 * std::atan2(n, sign * R.w());
  return n < 0.5 * kSmallAngle_rad ? Vector3d(2.0 * v * (1.0 + n * n / 6.0)) : Vector3d(v * (theta / n));
}

// METHOD (2)
//
//   exp([v; w]) = [ exp(w^)  V v ],   V = I + b w^ + c w^^2
Pose exp(const Vector6d& xi) noexcept {
  const Vector3d v = xi.head<3>();
  const Vector3d w = xi.tail<3>();
  const auto [b, c] = jacobian_terms(w.norm());
  const Vector3d wv = w.cross(v);
  return {rotation_from(w), v + b * wv + c * w.cross(wv)};
}

// METHOD (3)
//
//   V^-1 = I - w^/2 + (1/t^2)(1 - a/(2 b)) w^^2,   a = sin t / t,  b = (1 - cos t)/t^2
Vector6d log(const Pose& X) noexcept {
  const Vector3d w = rotation_vector(X.rotation);
  const double theta = w.norm();
  double d = 1.0 / 12.0 + theta * theta / 720.0;
  if (theta >= kSmallAngle_rad) {
    // a/(2b) = (t/2) cot(t/2), which stays finite up to t = pi; the quaternion holds cos and sin of t/2.
    const double cotangent = std::abs(X.rotation.w()) / X.rotation.vec().norm();
    d = (1.0 - 0.5 * theta * cotangent) / (theta * theta);
  }
  const Vector3d& p = X.translation_m;
  const Vector3d wp = w.cross(p);
  Vector6d xi;
  xi << p - 0.5 * wp + d * w.cross(wp), w;
  return xi;
}

Matrix3d hat(const Vector3d& w) noexcept {
  Matrix3d m;
  m << 0.0, -w.z(), w.y(),  //
      w.z(), 0.0, -w.x(),   //
      -w.y(), w.x(), 0.0;
  return m;
}

Matrix6d adjoint(const Pose& p) noexcept {
  const Matrix3d R = p.rotation.toRotationMatrix();
  Matrix6d Ad = Matrix6d::Zero();
  Ad.topLeftCorner<3, 3>() = R;
  Ad.topRightCorner<3, 3>() = hat(p.translation_m) * R;
  Ad.bottomRightCorner<3, 3>() = R;
  return Ad;
}

}  // namespace wrenchd
