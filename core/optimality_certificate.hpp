// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>

#include <Eigen/Core>

#include "core/contact_gap.hpp"
#include "core/hessian.hpp"
#include "core/pose.hpp"

namespace wrenchd {

// The dual certificate of global optimality (core/METHOD.md, section 6). For any multipliers m_i >= 0 the
// minimum of the Lagrangian over all u and all unit quaternions bounds T from below, METHOD (47). A
// vertex-face gap is quadratic in the quaternion, so the bound is an eigenvalue of a 4x4 matrix Z. All
// functions are RT-safe.

/// The matrix Z = 4 diag(0, H^) - sum m_i A_i, METHOD (48), with A_i of METHOD (46):
///
///   A = [ n.a      (a x n)'              ]        n . R(q) a = q' A q,   q = (w, x, y, z)
///       [ a x n    n a' + a n' - (n.a) I ]
///
/// H_hat: scaled inertia. Contacts whose multiplier is not positive do not count. Precondition: as many
/// multipliers as contacts.
Eigen::Matrix4d dual_matrix(const Matrix3d& H_hat, std::span<const LocalContact> contacts,
                            std::span<const double> multipliers) noexcept;

/// The rotation at which the dual bound is attained: eigenvector of the least eigenvalue of Z. A good further
/// start if the bound does not prove a result optimal.
Quaterniond dual_rotation(const Matrix3d& H_hat, std::span<const LocalContact> contacts,
                          std::span<const double> multipliers) noexcept;

/// True if the bound applies: each contact with a positive multiplier is a vertex-face contact.
bool has_dual_bound(std::span<const LocalContact> contacts, std::span<const double> multipliers) noexcept;

/// True if the bound meets T at a KKT point, METHOD (49): then no admissible pose is closer. Precondition:
/// has_dual_bound(). At a KKT point q is an eigenvector of Z; it belongs to the least eigenvalue if q' Z q
/// curves upwards on the unit sphere, that is if the Hessian of the Lagrangian is positive definite.
bool meets_dual_bound(const HessianBlocks& lagrangian_hessian) noexcept;

}  // namespace wrenchd
