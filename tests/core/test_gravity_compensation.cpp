// SPDX-License-Identifier: GPL-3.0-or-later
#include <limits>
#include <numbers>

#include <catch2/catch.hpp>

#include "core/gravity_compensation.hpp"
#include "core/inertia.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_gravity_compensation {

namespace {

using namespace test;

constexpr double g = kGravity_m_per_s2;

MovingMasses random_masses(RandomValues& random) {
  return {random.uniform(0.0, 1.0), random.vector<3>(0.05), random.uniform(0.0, 0.5)};
}

double power(const Wrench& F, const Twist& V) {
  return F.force_N.dot(V.linear_m_per_s) + F.torque_Nm.dot(V.angular_rad_per_s);
}

/// Returns X after a motion with constant velocity of the handle point, in base axes.
Pose moved(const Pose& X, const Twist& V, double time_s) {
  return {(rotation_from(time_s * V.angular_rad_per_s) * X.rotation).normalized(),
          X.translation_m + time_s * V.linear_m_per_s};
}

TEST_CASE("level base: the force points up, with a torque if the centre of mass is off the handle point",
          "[gravity]") {
  const GravityCompensation level({0.2, {0.0, 0.0, 0.05}, 0.1}, Quaterniond::Identity());
  const Wrench upright = level.wrench({});
  CHECK((upright.force_N - Vector3d(0, 0, 0.3 * g)).norm() < 1e-15);
  CHECK(upright.torque_Nm.norm() < 1e-15);  // the centre of mass is above the handle point

  // Tilted forward about y: the centre of mass is 5 cm ahead, so a torque is required.
  const Pose tipped{Quaterniond(Eigen::AngleAxisd(std::numbers::pi / 2, Vector3d::UnitY())), {0.1, 0.2, 0.3}};
  const Wrench held = level.wrench(tipped);
  CHECK((held.force_N - Vector3d(0, 0, 0.3 * g)).norm() < 1e-15);
  CHECK((held.torque_Nm - Vector3d(0, -0.2 * g * 0.05, 0)).norm() < 1e-15);
}

TEST_CASE("tilted base: the force follows the orientation of the base", "[gravity]") {
  // The x axis of B points up in the world.
  const Quaterniond R_WB(Eigen::AngleAxisd(-std::numbers::pi / 2, Vector3d::UnitY()));
  CHECK((R_WB * Vector3d::UnitX() - Vector3d::UnitZ()).norm() < 1e-15);
  const GravityCompensation wall({0.2, Vector3d::Zero(), 0.0}, R_WB);
  CHECK((wall.wrench({}).force_N - Vector3d(0.2 * g, 0, 0)).norm() < 1e-15);
  CHECK(wall.potential_energy_J({Quaterniond::Identity(), {0.5, 0, 0}}) == Approx(0.1 * g));
}

TEST_CASE("the wrench is the gradient of m g h", "[gravity]") {
  RandomValues random(7);
  constexpr double step_s = 1e-5;
  for (int i = 0; i < 2000; ++i) {
    const MovingMasses masses = random_masses(random);
    const Quaterniond R_WB = random.rotation();
    const GravityCompensation gravity(masses, R_WB);
    const Pose X_BH = random.pose(0.2);
    const Twist V = random.velocity();
    const double rise = gravity.potential_energy_J(moved(X_BH, V, step_s)) -
                        gravity.potential_energy_J(moved(X_BH, V, -step_s));
    CHECK(power(gravity.wrench(X_BH), V) == Approx(rise / (2 * step_s)).margin(1e-8));

    // The energy is m g h of each mass, in the world with z up.
    const double h_H = (R_WB * X_BH.translation_m).z(), h_C = (R_WB * (X_BH * masses.p_HHcm_m)).z();
    CHECK(gravity.potential_energy_J(X_BH) ==
          Approx(g * (masses.carried_kg * h_H + masses.handle_kg * h_C)).margin(1e-12));
  }
}

TEST_CASE("gravity compensation does no work around a closed path", "[gravity]") {
  RandomValues random(8);
  for (int way = 0; way < 20; ++way) {
    const GravityCompensation gravity(random_masses(random), random.rotation());
    // A closed polygon with rotations; Simpson's rule on each side.
    std::vector<Pose> corners;
    for (int i = 0; i < 5; ++i) corners.push_back(random.pose(0.2));
    corners.push_back(corners.front());
    double work_J = 0.0, moved_J = 0.0;
    for (std::size_t i = 0; i + 1 < corners.size(); ++i) {
      const Pose &from = corners[i], &to = corners[i + 1];
      const Twist V{to.translation_m - from.translation_m,
                    rotation_vector(to.rotation * from.rotation.conjugate())};
      constexpr int kParts = 400;
      for (int k = 0; k <= kParts; ++k) {
        const double weight = (k == 0 || k == kParts ? 1.0 : k % 2 == 1 ? 4.0 : 2.0) / (3.0 * kParts);
        const double rate_J = power(gravity.wrench(moved(from, V, static_cast<double>(k) / kParts)), V);
        work_J += weight * rate_J;
        moved_J += weight * std::abs(rate_J);
      }
    }
    CHECK(std::abs(work_J) < 1e-9 * moved_J);
  }
}

/// The handle as a free rigid body: gravity on its centre of mass, the motors at the handle point.
struct FreeHandle {
  MovingMasses masses;
  Inertia inertia;  ///< inertia of the handle about C; isotropic, so it does not depend on the rotation
  Quaterniond R_WB;
  Pose X_BH;
  Vector3d v_C = Vector3d::Zero();  ///< in B [m/s]
  Vector3d w = Vector3d::Zero();    ///< [rad/s]

  void step(const Wrench& motors, double h) {
    const Vector3d g_B = R_WB.conjugate() * Vector3d(0, 0, -g);
    const Vector3d p_CH = -(X_BH.rotation * masses.p_HHcm_m);
    v_C += h * (motors.force_N / masses.handle_kg + g_B);
    w += h * (motors.torque_Nm + p_CH.cross(motors.force_N)) / inertia.H_kg_m2(0, 0);
    const Vector3d p_BC = X_BH * masses.p_HHcm_m + h * v_C;
    X_BH.rotation = (rotation_from(h * w) * X_BH.rotation).normalized();
    X_BH.translation_m = p_BC - X_BH.rotation * masses.p_HHcm_m;
  }
  double kinetic_J() const {
    return 0.5 * (masses.handle_kg * v_C.squaredNorm() + inertia.H_kg_m2(0, 0) * w.squaredNorm());
  }
};

TEST_CASE("a compensated handle stays in place and coasts after a push", "[gravity]") {
  RandomValues random(9);
  constexpr double h = 1e-3;
  for (int i = 0; i < 20; ++i) {
    FreeHandle handle{{random.uniform(0.05, 1.0), random.vector<3>(0.03), 0.0},
                      {1.0, 2e-4 * Matrix3d::Identity()},
                      random.rotation(),
                      random.pose(0.1)};
    const GravityCompensation gravity(handle.masses, handle.R_WB);
    const GravityCompensation light({0.9 * handle.masses.handle_kg, handle.masses.p_HHcm_m, 0.0},
                                    handle.R_WB);
    FreeHandle falling = handle, sagging = handle, pushed = handle;
    const Pose start = handle.X_BH;
    pushed.v_C = random.vector<3>(0.1);
    pushed.w = random.vector<3>(0.5);
    const double hand_work_J = pushed.kinetic_J();
    for (int k = 0; k < 1000; ++k) {
      handle.step(gravity.wrench(handle.X_BH), h);
      pushed.step(gravity.wrench(pushed.X_BH), h);
      falling.step({}, h);
      sagging.step(light.wrench(sagging.X_BH), h);
    }
    CHECK((handle.X_BH.translation_m - start.translation_m).norm() < 1e-9);
    CHECK(handle.X_BH.rotation.angularDistance(start.rotation) < 1e-9);
    CHECK(pushed.kinetic_J() == Approx(hand_work_J).epsilon(1e-9));
    // Without compensation it falls freely; with nine tenths of its mass compensated, by a tenth of that.
    CHECK(falling.v_C.norm() == Approx(g).epsilon(1e-9));
    CHECK(sagging.v_C.norm() == Approx(0.1 * g).epsilon(1e-9));
  }
}

TEST_CASE("invalid masses are rejected", "[gravity]") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Quaterniond level = Quaterniond::Identity();
  CHECK_NOTHROW(GravityCompensation({}, level));
  CHECK_THROWS_WITH(GravityCompensation({-0.1, Vector3d::Zero(), 0.0}, level),
                    Catch::Contains("of the handle"));
  CHECK_THROWS_WITH(GravityCompensation({200.0, Vector3d::Zero(), 0.0}, level),
                    Catch::Contains("0 to 20 kg"));
  CHECK_THROWS_WITH(GravityCompensation({0.1, Vector3d::Zero(), nan}, level),
                    Catch::Contains("carried parts"));
  CHECK_THROWS_WITH(GravityCompensation({0.1, {0, 0, 50}, 0.0}, level), Catch::Contains("within 1 m"));
  CHECK_THROWS_WITH(GravityCompensation({0.1, {nan, 0, 0}, 0.0}, level), Catch::Contains("within 1 m"));
  CHECK_THROWS_WITH(GravityCompensation({}, Quaterniond(2, 0, 0, 0)), Catch::Contains("unit quaternion"));
  CHECK_THROWS_WITH(GravityCompensation({}, Quaterniond(nan, 0, 0, 0)), Catch::Contains("unit quaternion"));
}

TEST_CASE("gravity compensation neither allocates nor locks", "[gravity]") {
  RandomValues random(10);
  const GravityCompensation gravity(random_masses(random), random.rotation());
  const Pose X_BH = random.pose(0.1);
  Vector3d sum = Vector3d::Zero();
  std::uint64_t allocations = 0;
  {
    const RealtimeGuard guard;
    for (int i = 0; i < 1000; ++i) sum += gravity.wrench(X_BH).torque_Nm;
    allocations = guard.allocations() + guard.locks();
  }
  CHECK(allocations == 0);
  CHECK(sum.norm() > 0.0);
}

}  // namespace
}  // namespace wrenchd::test_gravity_compensation
