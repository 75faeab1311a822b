// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "core/pose.hpp"
#include "core/spatial.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_spatial {

using test::RandomValues;

namespace {

/// F . V: power of the wrench on a body with this twist [W].
double power_W(const Wrench& F, const Twist& V) {
  return F.force_N.dot(V.linear_m_per_s) + F.torque_Nm.dot(V.angular_rad_per_s);
}

double distance(const Wrench& a, const Wrench& b) {
  return (a.force_N - b.force_N).norm() + (a.torque_Nm - b.torque_Nm).norm();
}

double distance(const Twist& a, const Twist& b) {
  return (a.linear_m_per_s - b.linear_m_per_s).norm() + (a.angular_rad_per_s - b.angular_rad_per_s).norm();
}

}  // namespace

TEST_CASE("a force about another point has the additional torque of its lever", "[spatial]") {
  const Wrench up{{0.0, 0.0, 10.0}, {0.0, 0.0, 0.0}};
  const Wrench about_left = shifted(up, {-2.0, 0.0, 0.0});  // about a point 2 m to the left
  CHECK(about_left.force_N == up.force_N);
  CHECK(about_left.torque_Nm == Vector3d(0.0, -20.0, 0.0));  // r x f = (2, 0, 0) x (0, 0, 10)
}

TEST_CASE("a pure torque is the same about every point", "[spatial]") {
  RandomValues random(1);
  for (int i = 0; i < 100; ++i) {
    const Wrench F{Vector3d::Zero(), random.vector<3>()};
    REQUIRE(distance(shifted(F, random.vector<3>()), F) == 0.0);
  }
}

TEST_CASE("a point off the axis of a rotating body moves perpendicular to its lever", "[spatial]") {
  const Twist turning{{0.0, 0.0, 0.0}, {0.0, 0.0, 3.0}};
  const Twist outside = shifted(turning, {2.0, 0.0, 0.0});
  CHECK(outside.linear_m_per_s == Vector3d(0.0, 6.0, 0.0));
  CHECK(outside.angular_rad_per_s == turning.angular_rad_per_s);
}

TEST_CASE("a body without rotation has the same velocity at every point", "[spatial]") {
  RandomValues random(2);
  for (int i = 0; i < 100; ++i) {
    const Twist V{random.vector<3>(), Vector3d::Zero()};
    REQUIRE(distance(shifted(V, random.vector<3>()), V) == 0.0);
  }
}

TEST_CASE("changes of the point compose and can be inverted", "[spatial]") {
  RandomValues random(3);
  for (int i = 0; i < 2'000; ++i) {
    const Wrench F = random.wrench();
    const Twist V = random.velocity();
    const Vector3d a = random.vector<3>();
    const Vector3d b = random.vector<3>();
    REQUIRE(distance(shifted(shifted(F, a), b), shifted(F, a + b)) <= 1e-14);
    REQUIRE(distance(shifted(shifted(V, a), b), shifted(V, a + b)) <= 1e-14);
    REQUIRE(distance(shifted(shifted(F, a), -a), F) <= 1e-14);
    REQUIRE(distance(shifted(shifted(V, a), -a), V) <= 1e-14);
    REQUIRE(distance(shifted(F, Vector3d::Zero()), F) == 0.0);
    REQUIRE(distance(shifted(V, Vector3d::Zero()), V) == 0.0);
  }
}

TEST_CASE("changes of axes compose and can be inverted", "[spatial]") {
  RandomValues random(4);
  for (int i = 0; i < 2'000; ++i) {
    const Wrench F_C = random.wrench();
    const Twist V_C = random.velocity();
    const Quaterniond R_AB = random.rotation();
    const Quaterniond R_BC = random.rotation();
    REQUIRE(distance(expressed(R_AB, expressed(R_BC, F_C)), expressed(R_AB * R_BC, F_C)) <= 1e-14);
    REQUIRE(distance(expressed(R_AB, expressed(R_BC, V_C)), expressed(R_AB * R_BC, V_C)) <= 1e-14);
    REQUIRE(distance(expressed(R_BC.conjugate(), expressed(R_BC, F_C)), F_C) <= 1e-14);
    REQUIRE(distance(expressed(R_BC.conjugate(), expressed(R_BC, V_C)), V_C) <= 1e-14);
  }
}

TEST_CASE("changes of axes and of the point commute", "[spatial]") {
  RandomValues random(5);
  for (int i = 0; i < 2'000; ++i) {
    const Quaterniond R_AB = random.rotation();
    const Vector3d p_B = random.vector<3>();
    const Wrench F_B = random.wrench();
    const Twist V_B = random.velocity();
    REQUIRE(distance(expressed(R_AB, shifted(F_B, p_B)), shifted(expressed(R_AB, F_B), R_AB * p_B)) <= 1e-14);
    REQUIRE(distance(expressed(R_AB, shifted(V_B, p_B)), shifted(expressed(R_AB, V_B), R_AB * p_B)) <= 1e-14);
  }
}

TEST_CASE("power is the same about every point and in all axes", "[spatial]") {
  RandomValues random(6);
  for (int i = 0; i < 5'000; ++i) {
    const Wrench F = random.wrench();
    const Twist V = random.velocity();
    const Vector3d p = random.vector<3>();
    const Quaterniond R = random.rotation();
    const double power = power_W(F, V);
    REQUIRE(power_W(shifted(F, p), shifted(V, p)) == Approx(power).margin(2e-14));
    REQUIRE(power_W(expressed(R, F), expressed(R, V)) == Approx(power).margin(2e-14));
  }
}

TEST_CASE("wrenches add about any point", "[spatial]") {
  RandomValues random(7);
  for (int i = 0; i < 2'000; ++i) {
    const Wrench F = random.wrench();
    const Wrench G = random.wrench();
    const Vector3d p = random.vector<3>();
    REQUIRE(distance(shifted(F + G, p), shifted(F, p) + shifted(G, p)) <= 1e-14);
  }
}

TEST_CASE("changes of point and axes together are the adjoint transformation, METHOD (4)", "[spatial]") {
  RandomValues random(8);
  for (int i = 0; i < 2'000; ++i) {
    const Pose X_AB = random.pose();
    const Twist V_B = random.velocity();
    const Wrench F_B = random.wrench();
    Vector6d V;
    Vector6d F;
    V << V_B.linear_m_per_s, V_B.angular_rad_per_s;
    F << F_B.force_N, F_B.torque_Nm;
    const Vector6d V_by_matrix = adjoint(X_AB) * V;
    const Vector6d F_by_matrix = adjoint(inverse(X_AB)).transpose() * F;
    const Twist V_A = shifted(expressed(X_AB.rotation, V_B), -X_AB.translation_m);
    const Wrench F_A = shifted(expressed(X_AB.rotation, F_B), -X_AB.translation_m);
    REQUIRE(distance(V_A, Twist{V_by_matrix.head<3>(), V_by_matrix.tail<3>()}) <= 2e-14);
    REQUIRE(distance(F_A, Wrench{F_by_matrix.head<3>(), F_by_matrix.tail<3>()}) <= 2e-14);
  }
}

}  // namespace wrenchd::test_spatial
