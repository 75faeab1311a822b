// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/hessian.hpp"

#include <cmath>

namespace wrenchd {
namespace {

/// Inverse of the lower triangular root of a symmetric matrix: A = L D L', (L sqrt D)^-1 = D^-1/2 L^-1.
/// Returns false if the matrix is not positive definite or a pivot is dominated by rounding.
bool inverse_root(const Matrix3d& A, Matrix3d& inverse) noexcept {
  constexpr double kMinPivot = 1e-13;
  const auto safe = [](double pivot, double diagonal) { return pivot > kMinPivot * std::abs(diagonal); };
  const double d0 = A(0, 0);
  if (!(d0 > 0.0)) return false;
  const double l10 = A(1, 0) / d0;
  const double l20 = A(2, 0) / d0;
  const double d1 = A(1, 1) - l10 * A(1, 0);
  if (!safe(d1, A(1, 1))) return false;
  const double a21 = A(2, 1) - l20 * A(1, 0);
  const double l21 = a21 / d1;
  const double d2 = A(2, 2) - l20 * A(2, 0) - l21 * a21;
  if (!safe(d2, A(2, 2))) return false;
  const double i0 = 1.0 / std::sqrt(d0);
  const double i1 = 1.0 / std::sqrt(d1);
  const double i2 = 1.0 / std::sqrt(d2);
  inverse << i0, 0.0, 0.0, -l10 * i1, i1, 0.0, (l10 * l21 - l20) * i2, -l21 * i2, i2;
  return true;
}

}  // namespace

/// [2 I, C; C', B] = root root' with P = sqrt(2) I, Q = C'/sqrt(2), S S' = B - C'C/2.
bool factorise(const HessianBlocks& hessian, CholeskyFactor& factor) noexcept {
  constexpr double kSqrtHalf = 0.70710678118654752440;
  if (!inverse_root(hessian.B - 0.5 * hessian.C.transpose() * hessian.C, factor.S_inverse)) return false;
  factor.P_inverse = kSqrtHalf * Matrix3d::Identity();
  factor.Q = kSqrtHalf * hessian.C.transpose();
  return true;
}

Vector6d CholeskyFactor::solve(const Vector6d& y) const noexcept {
  Vector6d z;
  const Vector3d upper = P_inverse * y.head<3>();
  z.head<3>() = upper;
  z.tail<3>() = S_inverse * (y.tail<3>() - Q * upper);
  return z;
}

Vector6d CholeskyFactor::solve_transposed(const Vector6d& z) const noexcept {
  Vector6d y;
  const Vector3d lower = S_inverse.transpose() * z.tail<3>();
  y.head<3>() = P_inverse.transpose() * (z.head<3>() - Q.transpose() * lower);
  y.tail<3>() = lower;
  return y;
}

}  // namespace wrenchd
