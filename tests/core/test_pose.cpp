// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <catch2/catch.hpp>

#include "core/pose.hpp"
#include "tests/support/pose_matrix.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_pose {

using std::numbers::pi;
using test::matrix;
using test::RandomValues;

namespace {

using Eigen::Matrix4d;

/// xi^ of Eq. (4).
Matrix4d twist_matrix(const Vector6d& xi) {
  Matrix4d m = Matrix4d::Zero();
  m.topLeftCorner<3, 3>() = hat(xi.tail<3>());
  m.topRightCorner<3, 1>() = xi.head<3>();
  return m;
}

/// The matrix exponential by its series with scaling and squaring.
Matrix4d matrix_exponential(const Matrix4d& m) {
  const double length = m.cwiseAbs().rowwise().sum().maxCoeff();
  const int squarings = std::max(0, static_cast<int>(std::ceil(std::log2(4.0 * length))));
  const Matrix4d small = m / std::pow(2.0, squarings);
  Matrix4d term = Matrix4d::Identity();
  Matrix4d sum = term;
  for (int k = 1; k < 20; ++k) {
    term = term * small / k;
    sum += term;
  }
  for (int k = 0; k < squarings; ++k) sum = (sum * sum).eval();
  return sum;
}

double distance(const Pose& a, const Pose& b) {
  return (matrix(a) - matrix(b)).cwiseAbs().maxCoeff();
}

Vector6d turning(const Vector3d& v, const Vector3d& w) {
  Vector6d xi;
  xi << v, w;
  return xi;
}

}  // namespace

TEST_CASE("exp and log of zero are the identity and zero", "[pose]") {
  const Pose identity = exp(Vector6d::Zero());
  CHECK(identity.rotation.coeffs() == Quaterniond::Identity().coeffs());
  CHECK(identity.translation_m == Vector3d::Zero());
  CHECK(log(Pose{}) == Vector6d::Zero());
}

TEST_CASE("log undoes exp over random twists", "[pose]") {
  RandomValues random(1);
  for (int i = 0; i < 20'000; ++i) {
    const Vector6d xi = random.twist(random.log_uniform(1e-6, 1e3), 0.999 * pi);
    REQUIRE((log(exp(xi)) - xi).norm() <= 1e-13 * (1.0 + xi.norm()));
  }
}

TEST_CASE("exp undoes log over random poses", "[pose]") {
  RandomValues random(2);
  for (int i = 0; i < 20'000; ++i) {
    const Pose X = random.pose(random.log_uniform(1e-6, 1e3));
    REQUIRE(distance(exp(log(X)), X) <= 1e-14 * (1.0 + X.translation_m.norm()) * 5.0);
  }
}

TEST_CASE("log undoes exp to rounding for angles down to zero", "[pose]") {
  RandomValues random(3);
  for (int decade = -320; decade <= 0; ++decade) {
    const double angle = std::pow(10.0, decade);
    const Vector6d xi = turning(random.vector<3>(), angle * random.unit<3>());
    const Vector6d back = log(exp(xi));
    INFO("angle " << angle);
    REQUIRE((back.head<3>() - xi.head<3>()).norm() <= 1e-15 * xi.head<3>().norm() * 4.0);
    // Relative accuracy of each component: small angles are accurate beside large translations.
    const double scale = xi.tail<3>().stableNorm();
    REQUIRE((back.tail<3>() - xi.tail<3>()).stableNorm() <= 1e-15 * scale * 4.0 + 1e-323 * 4.0);
  }
}

TEST_CASE("the series and the closed form agree where they switch", "[pose]") {
  RandomValues random(4);
  for (int i = 0; i < 2'000; ++i) {
    const Vector6d xi = turning(random.vector<3>(), random.uniform(0.99e-4, 1.01e-4) * random.unit<3>());
    REQUIRE((matrix(exp(xi)) - matrix_exponential(twist_matrix(xi))).cwiseAbs().maxCoeff() <= 1e-14);
    REQUIRE((log(exp(xi)) - xi).norm() <= 4e-15 * (1.0 + xi.norm()));
  }
}

TEST_CASE("log undoes exp up to half a turn", "[pose]") {
  RandomValues random(5);
  for (int decade = -15; decade <= -1; ++decade) {
    for (int i = 0; i < 100; ++i) {
      const Vector6d xi = turning(random.vector<3>(), (pi - std::pow(10.0, decade)) * random.unit<3>());
      INFO("short of half a turn by 1e" << decade);
      REQUIRE((log(exp(xi)) - xi).norm() <= 1e-14 * (1.0 + xi.norm()));
    }
  }
}

TEST_CASE("at exactly half a turn log gives one of the two axes", "[pose]") {
  RandomValues random(6);
  for (int i = 0; i < 1'000; ++i) {
    Quaterniond half_turn;
    half_turn.w() = i % 2 == 0 ? 0.0 : -0.0;
    half_turn.vec() = random.unit<3>();
    const Pose X{half_turn, random.vector<3>()};
    const Vector6d xi = log(X);
    REQUIRE(xi.tail<3>().norm() == Approx(pi).epsilon(1e-15));
    REQUIRE(distance(exp(xi), X) <= 1e-14);
  }
}

TEST_CASE("log never rotates by more than half a turn, for both signs of the quaternion", "[pose]") {
  RandomValues random(7);
  for (int i = 0; i < 10'000; ++i) {
    const Pose X = random.pose();
    Pose other = X;
    other.rotation.coeffs() *= -1.0;
    const Vector6d xi = log(X);
    REQUIRE(xi.tail<3>().norm() <= pi * (1.0 + 1e-15));
    REQUIRE((log(other) - xi).norm() <= 1e-14 * xi.norm());
  }
}

TEST_CASE("the approximate rotation vector is accurate for small angles", "[pose]") {
  RandomValues random(12);
  for (int n = 0; n < 1000; ++n) {
    const double angle = random.log_uniform(1e-9, 0.5);
    Quaterniond turn = rotation_from(angle * random.unit<3>());
    if (random.chance(0.5)) turn.coeffs() *= -1.0;
    const Vector3d exact = rotation_vector(turn), small = small_rotation_vector(turn);
    CHECK(small.norm() <= exact.norm() * (1.0 + 1e-14));
    CHECK((small - exact).norm() <= std::pow(angle, 3) / 24.0 + 1e-14 * angle);
  }
}

TEST_CASE("exp is the matrix exponential", "[pose]") {
  RandomValues random(8);
  for (int i = 0; i < 5'000; ++i) {
    const Vector6d xi = random.twist(1.0, 2.0 * pi);
    const Matrix4d series = matrix_exponential(twist_matrix(xi));
    REQUIRE((matrix(exp(xi)) - series).cwiseAbs().maxCoeff() <= 5e-14 * (1.0 + xi.norm()));
  }
}

TEST_CASE("a rotation by more than half a turn equals the complementary rotation in the other direction",
          "[pose]") {
  RandomValues random(9);
  for (int i = 0; i < 2'000; ++i) {
    const Vector6d xi = random.twist(1.0, 20.0);
    const Pose X = exp(xi);
    REQUIRE(distance(exp(log(X)), X) <= 1e-13);
  }
}

TEST_CASE("motions about one screw axis add", "[pose]") {
  RandomValues random(10);
  for (int i = 0; i < 5'000; ++i) {
    const Vector6d xi = random.twist(1.0, 1.0);
    const double s = random.uniform(-1.5, 1.5);
    const double t = random.uniform(-1.5, 1.5);
    REQUIRE((log(exp(s * xi) * exp(t * xi)) - (s + t) * xi).norm() <= 1e-14 * (1.0 + xi.norm()));
  }
}

TEST_CASE("the log of an inverse is minus the log", "[pose]") {
  RandomValues random(11);
  for (int i = 0; i < 5'000; ++i) {
    const Pose X = random.pose();
    REQUIRE((log(inverse(X)) + log(X)).norm() <= 2e-14 * (1.0 + log(X).norm()));
  }
}

TEST_CASE("the log of a product agrees with Baker, Campbell and Hausdorff to third order", "[pose]") {
  RandomValues random(12);
  const auto bracket = [](const Vector6d& a, const Vector6d& b) {
    const Vector3d v = a.tail<3>().cross(b.head<3>()) - b.tail<3>().cross(a.head<3>());
    return turning(v, a.tail<3>().cross(b.tail<3>()));
  };
  for (const double size : {1e-2, 1e-3, 1e-4}) {
    for (int i = 0; i < 500; ++i) {
      const Vector6d a = size * random.unit<6>();
      const Vector6d b = size * random.unit<6>();
      const Vector6d ab = bracket(a, b);
      const Vector6d series = a + b + 0.5 * ab + (bracket(a, ab) - bracket(b, ab)) / 12.0;
      REQUIRE((log(exp(a) * exp(b)) - series).norm() <= std::pow(size, 4.0) + 1e-17);
    }
  }
}

TEST_CASE("the inverse undoes a pose from either side", "[pose]") {
  RandomValues random(13);
  for (int i = 0; i < 5'000; ++i) {
    const Pose X = random.pose();
    REQUIRE(distance(X * inverse(X), Pose{}) <= 4e-15);
    REQUIRE(distance(inverse(X) * X, Pose{}) <= 4e-15);
    REQUIRE(distance(inverse(inverse(X)), X) <= 4e-15);
  }
}

TEST_CASE("composition is matrix multiplication, for poses and points", "[pose]") {
  RandomValues random(14);
  for (int i = 0; i < 5'000; ++i) {
    const Pose X_AB = random.pose();
    const Pose X_BC = random.pose();
    const Vector3d p_C = random.vector<3>();
    REQUIRE((matrix(X_AB * X_BC) - matrix(X_AB) * matrix(X_BC)).cwiseAbs().maxCoeff() <= 1e-14);
    REQUIRE(((X_AB * X_BC) * p_C - X_AB * (X_BC * p_C)).norm() <= 1e-14);
  }
}

TEST_CASE("a chain of any length stays in SE(3)", "[pose]") {
  RandomValues random(15);
  Pose chain;
  Pose step = exp(random.twist(1e-3, 0.1));
  for (int i = 0; i < 200'000; ++i) {
    chain = chain * step;
    REQUIRE(std::abs(chain.rotation.norm() - 1.0) <= 4.0 * std::numeric_limits<double>::epsilon());
  }
  const Matrix3d R = chain.rotation.toRotationMatrix();
  CHECK((R * R.transpose() - Matrix3d::Identity()).cwiseAbs().maxCoeff() <= 1e-15);
  CHECK(R.determinant() == Approx(1.0).epsilon(1e-15));
}

TEST_CASE("a rotation in many small steps equals one rotation", "[pose]") {
  RandomValues random(16);
  constexpr int kSteps = 10'000;
  for (int i = 0; i < 10; ++i) {
    const Vector6d xi = random.twist(1.0, 3.0);
    const Pose step = exp(xi / kSteps);
    Pose chain;
    for (int k = 0; k < kSteps; ++k) chain = chain * step;
    REQUIRE(distance(chain, exp(xi)) <= 1e-11);
  }
}

TEST_CASE("hat is the cross product", "[pose]") {
  RandomValues random(17);
  for (int i = 0; i < 1'000; ++i) {
    const Vector3d a = random.vector<3>();
    const Vector3d b = random.vector<3>();
    REQUIRE((hat(a) * b - a.cross(b)).norm() <= 1e-15 * a.norm() * b.norm());
    REQUIRE(hat(a).transpose() == -hat(a));
  }
}

TEST_CASE("Ad_(pq) = Ad_p Ad_q", "[pose]") {
  RandomValues random(18);
  for (int i = 0; i < 5'000; ++i) {
    const Pose p = random.pose();
    const Pose q = random.pose();
    REQUIRE((adjoint(p * q) - adjoint(p) * adjoint(q)).cwiseAbs().maxCoeff() <= 2e-14);
    REQUIRE((adjoint(inverse(p)) * adjoint(p) - Matrix6d::Identity()).cwiseAbs().maxCoeff() <= 2e-14);
  }
  CHECK(adjoint(Pose{}) == Matrix6d::Identity());
}

TEST_CASE("p exp(xi) p^-1 = exp(Ad_p xi)", "[pose]") {
  RandomValues random(19);
  for (int i = 0; i < 5'000; ++i) {
    const Pose p = random.pose();
    const Vector6d xi = random.twist(1.0, pi);
    const Vector6d moved = adjoint(p) * xi;
    REQUIRE(distance(p * exp(xi) * inverse(p), exp(moved)) <= 2e-14 * (1.0 + moved.norm()));
  }
}

}  // namespace wrenchd::test_pose
