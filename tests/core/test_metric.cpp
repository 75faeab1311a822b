// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <numbers>

#include <Eigen/Eigenvalues>
#include <catch2/catch.hpp>

#include "core/metric.hpp"
#include "tests/support/pose_matrix.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_metric {

using std::numbers::pi;
using test::matrix;
using test::RandomValues;

namespace {

using Eigen::Matrix4d;

/// M of Eq. (13).
Matrix6d generalised(const Inertia& M) {
  Matrix6d m = Matrix6d::Zero();
  m.topLeftCorner<3, 3>() = M.mass_kg * Matrix3d::Identity();
  m.bottomRightCorner<3, 3>() = M.H_kg_m2;
  return m;
}

/// V~ of Eq. (12), literally with 4 x 4 matrices:  [V~]^ = exp(-xi^/2) p^-1 (q - p),  xi = log(p^-1 q).
/// The result is a twist matrix up to rounding; returns its skew part.
Vector6d literal_velocity(const Pose& p, const Pose& q) {
  const Vector6d xi = log(inverse(p) * q);
  const Matrix4d V = matrix(exp(-0.5 * xi)) * (matrix(inverse(p)) * (matrix(q) - matrix(p)));
  Vector6d v;
  v << V.topRightCorner<3, 1>(), 0.5 * (V(2, 1) - V(1, 2)), 0.5 * (V(0, 2) - V(2, 0)),
      0.5 * (V(1, 0) - V(0, 1));
  return v;
}

/// Eq. (8), literally with any 6 x 6 inertia.
double literal_energy(const Matrix6d& M, const Pose& p, const Pose& q) {
  const Vector6d V = literal_velocity(p, q);
  return V.dot(M * V);
}

struct Case {
  Inertia M;
  Pose p;
  Pose q;
};

Case random_case(RandomValues& random) {
  return {random.inertia(), random.pose(), random.pose()};
}

Inertia with_lengths_times(double c, const Inertia& M) {
  return {M.mass_kg, c * c * M.H_kg_m2};
}
Pose with_lengths_times(double c, const Pose& X) {
  return {X.rotation, c * X.translation_m};
}

}  // namespace

TEST_CASE("the closed form is Eq. (8) with the velocity of Eq. (12)", "[metric]") {
  RandomValues random(1);
  for (int i = 0; i < 20'000; ++i) {
    const auto [M, p, q] = random_case(random);
    const double T = energy(M, p, q);
    REQUIRE(std::abs(literal_energy(generalised(M), p, q) - T) <= 1e-14 * T);
  }
}

TEST_CASE("Eq. (12) is a twist: its matrix has a skew rotation part and an empty last row", "[metric]") {
  RandomValues random(2);
  for (int i = 0; i < 2'000; ++i) {
    const auto [M, p, q] = random_case(random);
    const Vector6d xi = log(inverse(p) * q);
    const Matrix4d V = matrix(exp(-0.5 * xi)) * (matrix(inverse(p)) * (matrix(q) - matrix(p)));
    REQUIRE((V.topLeftCorner<3, 3>() + V.topLeftCorner<3, 3>().transpose()).cwiseAbs().maxCoeff() <= 1e-14);
    REQUIRE(V.row(3).cwiseAbs().maxCoeff() == 0.0);
    // |V_ang| = 2 sin(theta/2)
    REQUIRE(literal_velocity(p, q).tail<3>().norm() ==
            Approx(2.0 * std::sin(0.5 * xi.tail<3>().norm())).epsilon(1e-13));
  }
}

TEST_CASE("T does not depend on the inertial frame: T(ap, aq) = T(p, q)", "[metric]") {
  RandomValues random(3);
  for (int i = 0; i < 10'000; ++i) {
    const auto [M, p, q] = random_case(random);
    const Pose a = random.pose();
    const double T = energy(M, p, q);
    REQUIRE(std::abs(energy(M, a * p, a * q) - T) <= 2e-14 * T + 1e-15);
  }
}

TEST_CASE("T does not depend on the body frame: T(pb, qb) = T(p, q) with M transformed", "[metric]") {
  // In the frame b the body velocity is Ad_(b^-1) V, so the same energy requires M_b = Ad_b' M Ad_b.
  RandomValues random(4);
  for (int i = 0; i < 10'000; ++i) {
    const auto [M, p, q] = random_case(random);
    const Pose b = random.pose();
    const Matrix6d M_b = adjoint(b).transpose() * generalised(M) * adjoint(b);
    const double T = energy(M, p, q);
    REQUIRE(std::abs(literal_energy(M_b, p * b, q * b) - T) <= 1e-12 * T);
  }
}

TEST_CASE("rotating the body axes rotates H and keeps T", "[metric]") {
  RandomValues random(5);
  for (int i = 0; i < 5'000; ++i) {
    const auto [M, p, q] = random_case(random);
    const Pose b{random.rotation(), Vector3d::Zero()};
    const Matrix3d R = b.rotation.toRotationMatrix();
    const Inertia M_b{M.mass_kg, R.transpose() * M.H_kg_m2 * R};
    const double T = energy(M, p, q);
    REQUIRE(std::abs(energy(M_b, p * b, q * b) - T) <= 1e-13 * T);
  }
}

TEST_CASE("all lengths times c: T times c^2 at equal mass", "[metric]") {
  RandomValues random(6);
  for (int i = 0; i < 5'000; ++i) {
    const auto [M, p, q] = random_case(random);
    const double c = random.log_uniform(1e-6, 1e6);
    const double T = energy(with_lengths_times(c, M), with_lengths_times(c, p), with_lengths_times(c, q));
    REQUIRE(T == Approx(c * c * energy(M, p, q)).epsilon(1e-14));
  }
}

TEST_CASE("scaling all lengths does not change which of two configurations is nearer", "[metric]") {
  RandomValues random(7);
  for (int i = 0; i < 5'000; ++i) {
    const auto [M, p, q] = random_case(random);
    const Pose r = random.pose();
    const double c = std::ldexp(1.0, random.integer(-20, 20));  // a power of two, which is exact
    const auto scaled = [c](const Pose& X) { return with_lengths_times(c, X); };
    const Inertia M_c = with_lengths_times(c, M);
    REQUIRE((energy(M_c, scaled(p), scaled(q)) < energy(M_c, scaled(p), scaled(r))) ==
            (energy(M, p, q) < energy(M, p, r)));
  }
}

TEST_CASE("mass times c: T times c, and no configuration becomes nearer than another", "[metric]") {
  RandomValues random(8);
  for (int i = 0; i < 5'000; ++i) {
    const auto [M, p, q] = random_case(random);
    const Pose r = random.pose();
    const double c = random.log_uniform(1e-3, 1e3);
    const Inertia heavier{c * M.mass_kg, c * M.H_kg_m2};
    REQUIRE(energy(heavier, p, q) == Approx(c * energy(M, p, q)).epsilon(1e-14));
    REQUIRE(energy(heavier, p, q) / energy(heavier, p, r) ==
            Approx(energy(M, p, q) / energy(M, p, r)).epsilon(1e-13));
  }
}

TEST_CASE("T = 0 if p = q, for both signs of the quaternion", "[metric]") {
  RandomValues random(9);
  for (int i = 0; i < 2'000; ++i) {
    const auto [M, p, q] = random_case(random);
    Pose same = p;
    same.rotation.coeffs() *= -1.0;
    REQUIRE(energy(M, p, p) <= 1e-30 * M.H_kg_m2.trace());
    REQUIRE(energy(M, p, same) <= 1e-30 * M.H_kg_m2.trace());
    same = q;
    same.rotation.coeffs() *= -1.0;
    REQUIRE(energy(M, p, same) == energy(M, p, q));
  }
}

TEST_CASE("T = 0 only if p = q: T has a lower bound from rotation and translation", "[metric]") {
  RandomValues random(10);
  for (int i = 0; i < 5'000; ++i) {
    const Inertia M = random.inertia();
    const Pose p = random.pose();
    const double angle = random.log_uniform(1e-7, pi);
    const double shift = random.log_uniform(1e-7, 1.0);
    const Pose turned{p.rotation * random.rotation(angle), p.translation_m};
    const Pose moved{p.rotation, p.translation_m + shift * random.unit<3>()};
    const double least_moment = Eigen::SelfAdjointEigenSolver<Matrix3d>(M.H_kg_m2).eigenvalues()[0];
    const double half = std::sin(0.5 * angle);
    REQUIRE(energy(M, p, turned) >= 4.0 * least_moment * half * half * (1.0 - 1e-8));
    REQUIRE(energy(M, p, moved) == Approx(M.mass_kg * shift * shift).epsilon(1e-8));
  }
}

TEST_CASE("T is symmetric: T(p, q) = T(q, p)", "[metric]") {
  RandomValues random(11);
  for (int i = 0; i < 10'000; ++i) {
    const auto [M, p, q] = random_case(random);
    REQUIRE(energy(M, q, p) == Approx(energy(M, p, q)).epsilon(1e-14));
  }
}

TEST_CASE("T is exactly quadratic in the translation and the vector part of the quaternion", "[metric]") {
  RandomValues random(12);
  for (int i = 0; i < 5'000; ++i) {
    const Inertia M = random.inertia();
    const Pose p = random.pose();
    const Vector3d s = random.vector<3>();
    const Vector3d v = random.uniform(0.0, 0.49) * random.unit<3>();
    const auto at = [&](double t) {
      Quaterniond E;
      E.vec() = t * v;
      E.w() = std::sqrt(1.0 - t * t * v.squaredNorm());
      return energy(M, p, Pose{p.rotation * E, p.translation_m + t * s});
    };
    REQUIRE(at(2.0) == Approx(4.0 * at(1.0)).epsilon(1e-13));
    REQUIRE(at(-1.0) == Approx(at(1.0)).epsilon(1e-13));
  }
}

TEST_CASE("in the plane T is Eq. (18)", "[metric]") {
  RandomValues random(13);
  for (int i = 0; i < 2'000; ++i) {
    const Inertia M = random.inertia();
    const double phi = random.uniform(-1.0, 1.0);
    const double theta = random.uniform(-1.0, 1.0);
    const double h = random.normal();
    const double beta = random.normal();
    const auto upright = [](double angle, double height) {
      return Pose{Quaterniond(Eigen::AngleAxisd(angle, Vector3d::UnitZ())), Vector3d(0.3, height, 0.0)};
    };
    const double half = std::sin(0.5 * (theta - phi));
    const double planar = M.mass_kg * (beta - h) * (beta - h) + 4.0 * M.H_kg_m2(2, 2) * half * half;
    REQUIRE(energy(M, upright(phi, h), upright(theta, beta)) == Approx(planar).epsilon(1e-13).margin(1e-15));
  }
}

TEST_CASE("example 4.1: the energy between the paper's p and q", "[metric]") {
  const Inertia cube{1.0, 2500.0 / 6.0 * Matrix3d::Identity()};
  const auto upright = [](double angle, double height) {
    return Pose{Quaterniond(Eigen::AngleAxisd(angle, Vector3d::UnitZ())), Vector3d(0.0, height, 0.0)};
  };
  const Pose p = upright(-0.2, 25.0);
  const Pose q = upright(-0.0867146202807576, 27.0712157435851);
  CHECK(energy(cube, p, q) == Approx(9.63154218539309).epsilon(1e-13));
  const Vector6d xi_p = log(p);
  CHECK(xi_p[0] == Approx(-2.5).epsilon(1e-14));
  CHECK(xi_p[1] == Approx(24.91661106).epsilon(1e-9));
  const Vector6d xi_q = log(q);
  CHECK(xi_q[0] == Approx(-1.1737351).epsilon(1e-7));
  CHECK(xi_q[1] == Approx(27.05425029).epsilon(1e-9));
  const Vector6d eps = log(inverse(p) * q);
  CHECK(eps[0] == Approx(-0.29606622).epsilon(1e-7));
  CHECK(eps[1] == Approx(2.05106566).epsilon(1e-8));
  CHECK(eps[5] == Approx(0.11328538).epsilon(1e-7));
}

}  // namespace wrenchd::test_metric
