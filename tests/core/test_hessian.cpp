// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "core/hessian.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_hessian {

using test::RandomValues;

namespace {

Matrix6d matrix(const HessianBlocks& h) {
  Matrix6d W;
  W << 2.0 * Matrix3d::Identity(), h.C, h.C.transpose(), h.B;
  return W;
}

/// Returns a Hessian with the Schur complement B - C'C/2 = S.
HessianBlocks with_schur_complement(RandomValues& random, const Matrix3d& S) {
  HessianBlocks h;
  h.C = Matrix3d::NullaryExpr([&] { return random.normal(); });
  h.B = S + 0.5 * h.C.transpose() * h.C;
  return h;
}

Matrix3d positive_definite(RandomValues& random) {
  const Matrix3d A = Matrix3d::NullaryExpr([&] { return random.normal(); });
  return A * A.transpose() + 0.1 * Matrix3d::Identity();
}

}  // namespace

TEST_CASE("a Cholesky factor solves with the root and its transpose", "[hessian]") {
  RandomValues random(211);
  for (int i = 0; i < 200; ++i) {
    const HessianBlocks h = with_schur_complement(random, positive_definite(random));
    CholeskyFactor factor;
    REQUIRE(factorise(h, factor));
    const Vector6d y = random.vector<6>();
    const Vector6d x = factor.solve_transposed(factor.solve(y));
    CHECK((matrix(h) * x - y).norm() < 1e-9 * (1.0 + x.norm()));
  }
}

TEST_CASE("a Hessian that is not positive definite has no factor", "[hessian]") {
  RandomValues random(212);
  for (int i = 0; i < 200; ++i) {
    const Vector3d v = random.unit<3>();
    const Matrix3d S = positive_definite(random);
    const double curvature = v.dot(S * v);
    CholeskyFactor factor;
    CHECK_FALSE(factorise(with_schur_complement(random, S - 1.5 * curvature * v * v.transpose()), factor));
  }
}

TEST_CASE("a Hessian that is singular up to rounding has no factor", "[hessian]") {
  CholeskyFactor factor;
  HessianBlocks h;
  h.B = Vector3d(1.0, 1.0, 1e-15).asDiagonal();
  const Matrix3d R = Quaterniond(0.5, 0.5, 0.5, 0.5).toRotationMatrix();
  h.B = R * h.B * R.transpose();
  h.B += Matrix3d::Constant(1.0);
  h.B(2, 2) = h.B(1, 2) * h.B(1, 2) / h.B(1, 1);
  h.B(0, 2) = h.B(2, 0) = h.B(0, 1) * h.B(1, 2) / h.B(1, 1);
  CHECK_FALSE(factorise(h, factor));
}

}  // namespace wrenchd::test_hessian
