// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace wrenchd {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

/// A configuration in SE(3), Eq. (2): X_AB is the pose of frame B in frame A.
///
///   p_A = R_AB p_B + p_AB        products chain: X_AC = X_AB * X_BC
///
/// The rotation is kept as a unit quaternion, because the kinetic-energy metric (core/metric.hpp) is exactly
/// quadratic in its vector part. Everything here is RT safe.
struct Pose {
  Quaterniond rotation = Quaterniond::Identity();  ///< R_AB, unit norm
  Vector3d translation_m = Vector3d::Zero();       ///< p_AB: origin of B in A [m]

  /// Point known in B, expressed in A [m].
  Vector3d operator*(const Vector3d& p_B) const noexcept { return rotation * p_B + translation_m; }
};

/// X_AC = X_AB * X_BC. The product is renormalised, so a chain of any length stays in SE(3).
Pose operator*(const Pose& X_AB, const Pose& X_BC) noexcept;

/// X_BA from X_AB.
Pose inverse(const Pose& X_AB) noexcept;

/// Are all their numbers the same?
inline bool same_bits(const Pose& a, const Pose& b) noexcept {
  return a.rotation.coeffs() == b.rotation.coeffs() && a.translation_m == b.translation_m;
}

/// Exponential coordinates to configuration. xi = [v; w] (linear [m] first, angular [rad] second,
/// section 2.2).
Pose exp(const Vector6d& xi) noexcept;

/// Exponential coordinates xi = [v; w] of a configuration, |w| <= pi. Inverse of exp().
Vector6d log(const Pose& X) noexcept;

/// Rotation by |w| about w [rad]: the rotational half of exp().
Quaterniond rotation_from(const Vector3d& w) noexcept;

/// Axis times angle of a unit quaternion [rad], at most pi long: the rotational half of log().
Vector3d rotation_vector(const Quaterniond& R) noexcept;

/// The same for a turn that is far from half a turn, without a trigonometric function: axis times
/// 2 sin(angle/2), short by angle^3 / 24 and less.
inline Vector3d small_rotation_vector(const Quaterniond& R) noexcept {
  return (R.w() < 0.0 ? -2.0 : 2.0) * R.vec();
}

/// The 6x6 adjoint transformation of section 2.4, acting on [v; w]:
///
///   Ad_p = [ R  d^R ]
///          [ 0   R  ]
Matrix6d adjoint(const Pose& p) noexcept;

/// w^ with w^ x = w cross x (Eq. 3).
Matrix3d hat(const Vector3d& w) noexcept;

}  // namespace wrenchd
