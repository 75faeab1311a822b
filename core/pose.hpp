// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace wrenchd {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;
// A program that disagrees with the library about Eigen's alignment reads other numbers than were written.
static_assert(alignof(Quaterniond) == alignof(double),
              "define EIGEN_DONT_VECTORIZE before Eigen is included; linking with wrenchd::core does it");
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

/// A configuration in SE(3), Eq. (2): X_AB is the pose of frame B in frame A.
///
///   p_A = R_AB p_B + p_AB        products chain: X_AC = X_AB * X_BC, METHOD (1)
///
/// The rotation is a unit quaternion, because the kinetic-energy metric (core/metric.hpp) is quadratic in its
/// vector part. All functions in this file are RT-safe.
struct Pose {
  Quaterniond rotation = Quaterniond::Identity();  ///< R_AB, unit norm
  Vector3d translation_m = Vector3d::Zero();       ///< p_AB: origin of B in A [m]

  /// Transforms a point from B to A [m].
  Vector3d operator*(const Vector3d& p_B) const noexcept { return rotation * p_B + translation_m; }
};

/// X_AC = X_AB * X_BC, METHOD (1). Normalizes the rotation, so a long chain stays in SE(3).
Pose operator*(const Pose& X_AB, const Pose& X_BC) noexcept;

/// X_BA for a given X_AB.
Pose inverse(const Pose& X_AB) noexcept;

/// True if all numbers of both poses are equal.
inline bool same_bits(const Pose& a, const Pose& b) noexcept {
  return a.rotation.coeffs() == b.rotation.coeffs() && a.translation_m == b.translation_m;
}

/// A pose as records and files store it: translation x, y, z [m], then the unit quaternion x, y, z, w.
using PoseNumbers = std::array<double, 7>;

/// The stored numbers of a pose. RT-safe.
inline PoseNumbers numbers_of(const Pose& X) noexcept {
  const auto& [q, p] = X;
  return {p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w()};
}

/// The pose of stored numbers, bit for bit; it does not normalize the quaternion. RT-safe.
inline Pose pose_from_numbers(const PoseNumbers& x) noexcept {
  return {Quaterniond(x[6], x[3], x[4], x[5]), {x[0], x[1], x[2]}};
}

/// Configuration for the exponential coordinates xi = [v; w] (linear [m] first, angular [rad] second), METHOD
/// (2); paper, section 2.2.
Pose exp(const Vector6d& xi) noexcept;

/// Exponential coordinates xi = [v; w] of a configuration, |w| <= pi, METHOD (3). Inverse of exp().
Vector6d log(const Pose& X) noexcept;

/// Rotation by the angle |w| about the axis w [rad]; the rotational part of exp().
Quaterniond rotation_from(const Vector3d& w) noexcept;

/// Rotation vector (axis times angle) of a unit quaternion [rad], length at most pi; the rotational part of
/// log().
Vector3d rotation_vector(const Quaterniond& R) noexcept;

/// Approximate rotation vector without trigonometric functions, for angles well below pi: axis times 2
/// sin(angle/2). It is too short by at most angle^3 / 24.
inline Vector3d small_rotation_vector(const Quaterniond& R) noexcept {
  return (R.w() < 0.0 ? -2.0 : 2.0) * R.vec();
}

/// The 6x6 adjoint transformation on [v; w], METHOD (4); paper, section 2.4:
///
///   Ad_p = [ R  d^R ]
///          [ 0   R  ]
Matrix6d adjoint(const Pose& p) noexcept;

/// The matrix w^ with w^ x = w cross x, Eq. (3).
Matrix3d hat(const Vector3d& w) noexcept;

}  // namespace wrenchd
