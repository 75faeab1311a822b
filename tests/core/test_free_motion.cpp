// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>

#include <catch2/catch.hpp>

#include "core/free_motion.hpp"

namespace wrenchd::test_free_motion {

namespace {

const Inertia kThreeMoments = {0.3, Vector3d(2e-4, 3e-4, 4.5e-4).asDiagonal()};

BodyMotion spinning(const Inertia& M, const Vector3d& omega_W) {
  BodyMotion motion;
  motion.X_WB.rotation = rotation_from({0.3, -0.4, 0.2});
  set_angular_velocity_W(M, omega_W, motion);
  return motion;
}

BodyMotion after(const Inertia& M, BodyMotion motion, const FreeForces& forces, double dt_s, double until_s) {
  const int steps = static_cast<int>(std::lround(until_s / dt_s));
  for (int k = 0; k < steps; ++k) motion = moved_freely(M, motion, forces, dt_s);
  return motion;
}

TEST_CASE("a body falls as gravity says", "[free_motion]") {
  BodyMotion motion;
  motion.velocity_W_m_per_s = {0.4, 0.0, 3.0};
  const Vector3d g(0.0, 0.0, -9.81);
  const BodyMotion end = after(kThreeMoments, motion, {g}, 1e-3, 10.0);
  const Vector3d expected = 10.0 * motion.velocity_W_m_per_s + 50.0 * g;
  CHECK((end.X_WB.translation_m - expected).norm() < 1e-9 * expected.norm());
  CHECK((end.velocity_W_m_per_s - (motion.velocity_W_m_per_s + 10.0 * g)).norm() < 1e-9);
}

TEST_CASE("a damped body approaches its final velocity", "[free_motion]") {
  BodyMotion motion = spinning(kThreeMoments, {1.0, 2.0, 3.0});
  motion.velocity_W_m_per_s = {1.0, 0.0, 0.0};
  const FreeForces forces = {{0.0, 0.0, -9.81}, 2.0, 0.5};
  const BodyMotion end = after(kThreeMoments, motion, forces, 1e-3, 1.0);
  const double decay = std::exp(-2.0);
  CHECK(std::abs(end.velocity_W_m_per_s.x() - decay) < 1e-12);
  CHECK(std::abs(end.velocity_W_m_per_s.z() + 9.81 / 2.0 * (1.0 - decay)) < 1e-12);
  CHECK(std::abs(end.X_WB.translation_m.x() - (1.0 - decay) / 2.0) < 1e-12);
  CHECK(std::abs(end.X_WB.translation_m.z() + 9.81 / 2.0 * (1.0 - (1.0 - decay) / 2.0)) < 1e-12);
  CHECK((end.spin_W - std::exp(-0.5) * motion.spin_W).norm() < 1e-12 * motion.spin_W.norm());
}

TEST_CASE("a top without torque keeps energy and angular momentum", "[free_motion]") {
  // Near the middle axis the motion is unstable: the body turns over again and again.
  const BodyMotion motion = spinning(kThreeMoments, {0.5, 12.0, 0.7});
  const BodyMotion end = after(kThreeMoments, motion, {}, 1e-3, 10.0);
  CHECK(end.spin_W == motion.spin_W);
  const double before_J = kinetic_energy_J(kThreeMoments, motion);
  CHECK(std::abs(kinetic_energy_J(kThreeMoments, end) - before_J) < 1e-6 * before_J);
}

TEST_CASE("the rotation has an error of fourth order", "[free_motion]") {
  // A step takes at most 16 parts, so parts of 0.1 rad are possible.
  const BodyMotion motion = spinning(kThreeMoments, {2.0, 3.0, 1.5});
  const auto end = [&](double dt_s) { return after(kThreeMoments, motion, {}, dt_s, 3.2).X_WB.rotation; };
  const Quaterniond exact = end(0.002);
  const double coarse = exact.angularDistance(end(0.8)), fine = exact.angularDistance(end(0.4));
  INFO(coarse << " and " << fine);
  CHECK(coarse / fine > 12.0);
  CHECK(coarse / fine < 20.0);
}

TEST_CASE("a symmetric top precesses about its angular momentum", "[free_motion]") {
  const Inertia M = {0.2, Vector3d(3e-4, 3e-4, 5e-4).asDiagonal()};
  const BodyMotion motion = spinning(M, {1.0, 2.0, 6.0});
  const double time_s = 4.0;
  const BodyMotion end = after(M, motion, {}, 1e-3, time_s);
  // The axis turns about the angular momentum L at the rate |L| / I_1.
  const Vector3d axis = motion.X_WB.rotation * Vector3d::UnitZ();
  const Vector3d expected = rotation_from(motion.spin_W / 3e-4 * time_s) * axis;
  CHECK((end.X_WB.rotation * Vector3d::UnitZ() - expected).norm() < 1e-8);
}

}  // namespace
}  // namespace wrenchd::test_free_motion
