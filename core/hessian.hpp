// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/pose.hpp"

namespace wrenchd {

/// Blocks of a Hessian in (u, eta), the scaled translation and rotation of the tool: [2 I, C; C', B], METHOD
/// (38).
struct HessianBlocks {
  Matrix3d C = Matrix3d::Zero();
  Matrix3d B = Matrix3d::Zero();
};

/// Triangular root [P 0; Q S] of a positive definite matrix, with P and S inverted. RT-safe.
struct CholeskyFactor {
  Matrix3d P_inverse, Q, S_inverse;

  Vector6d solve(const Vector6d& y) const noexcept;             ///< inverse of the root times y
  Vector6d solve_transposed(const Vector6d& z) const noexcept;  ///< inverse of the transposed root times z
};

/// Factorises a Hessian. Returns false if it is not positive definite, or a pivot is dominated by rounding;
/// then `factor` has no defined value. RT-safe.
bool factorise(const HessianBlocks& hessian, CholeskyFactor& factor) noexcept;

}  // namespace wrenchd
