// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "daemon/servo/workspace.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_workspace {

namespace {

using namespace test;

constexpr double kTick_s = 1e-3;

double distance(const Pose& a, const Pose& b) {
  return (a.translation_m - b.translation_m).norm() + a.rotation.angularDistance(b.rotation);
}

TEST_CASE("a workspace without changes applies the base pose", "[workspace]") {
  RandomValues random(1);
  const Pose X_WB = random.pose();
  Workspace workspace(X_WB);
  for (int i = 0; i < 100; ++i) {
    const Pose X_BH = random.pose();
    CHECK(same_bits(workspace.update(X_BH, kTick_s), X_WB * X_BH));
  }
}

TEST_CASE("the scale changes over 100 ms without moving the tool", "[workspace]") {
  RandomValues random(2);
  const double to = GENERATE(0.3, 3.0);
  Workspace workspace(random.pose());
  const Pose X_BH = random.pose();
  const Pose X_WH = workspace.update(X_BH, kTick_s);
  workspace.set_scale(to);
  int ticks = 0;
  for (; workspace.scale() != to && ticks < 1000; ++ticks)
    CHECK(distance(workspace.update(X_BH, kTick_s), X_WH) < 1e-12);
  CHECK(ticks >= 99);
  CHECK(ticks <= 101);
  // After the ramp, tool motion is the scale times handle motion.
  const Pose further = {X_BH.rotation, X_BH.translation_m + Vector3d(0.01, 0.02, -0.01)};
  CHECK((workspace.update(further, kTick_s).translation_m - X_WH.translation_m).norm() ==
        Approx(to * Vector3d(0.01, 0.02, -0.01).norm()));
}

TEST_CASE("the wrench has equal power at the hand and in the world at every scale", "[workspace]") {
  RandomValues random(3);
  for (int i = 0; i < 200; ++i) {
    Workspace workspace(random.pose());
    workspace.set_scale(random.uniform(0.1, 10.0));
    const Pose X_BH = random.pose();
    for (int k = 0; k < 200; ++k) workspace.update(X_BH, kTick_s);
    const Wrench F_W = random.wrench();
    const Twist V_BH = random.velocity();
    const Twist V_W = workspace.twist_in_world(V_BH);
    const Wrench F_B = workspace.wrench_on_hand(F_W);
    CHECK(F_B.force_N.dot(V_BH.linear_m_per_s) + F_B.torque_Nm.dot(V_BH.angular_rad_per_s) ==
          Approx(F_W.force_N.dot(V_W.linear_m_per_s) + F_W.torque_Nm.dot(V_W.angular_rad_per_s)));
    // The twist is the derivative of update().
    const double dt = 1e-7;
    const Pose now = workspace.update(X_BH, 0.0);
    const Pose then = workspace.update({X_BH.rotation, X_BH.translation_m + dt * V_BH.linear_m_per_s}, 0.0);
    CHECK((then.translation_m - now.translation_m - dt * V_W.linear_m_per_s).norm() < 1e-12);
  }
}

TEST_CASE("the clutch holds the tool, and motion continues from the given pose", "[workspace]") {
  RandomValues random(4);
  Workspace workspace(random.pose());
  workspace.set_scale(2.0);
  const Pose X_WH = workspace.update(random.pose(), kTick_s);
  workspace.engage_clutch();
  for (int i = 0; i < 10; ++i) CHECK(same_bits(workspace.update(random.pose(), kTick_s), X_WH));
  const Pose X_on = random.pose();
  workspace.disengage_clutch(X_on);
  const Pose X_BH = random.pose();
  CHECK(distance(workspace.update(X_BH, kTick_s), X_on) < 1e-12);
  const Pose rotated = {X_BH.rotation * rotation_from({0.0, 0.1, 0.0}), X_BH.translation_m};
  CHECK(distance(workspace.update(rotated, kTick_s),
                 {X_on.rotation * rotation_from({0.0, 0.1, 0.0}), workspace.X_WH().translation_m}) < 1e-9);
}

TEST_CASE("recentring restores the configured base pose", "[workspace]") {
  RandomValues random(5);
  const Pose X_WB = random.pose();
  Workspace workspace(X_WB);
  workspace.engage_clutch();
  workspace.disengage_clutch(random.pose());
  workspace.update(random.pose(), kTick_s);
  workspace.recentre();
  const Pose X_BH = random.pose();
  CHECK(distance(workspace.update(X_BH, kTick_s), X_WB * X_BH) < 1e-15);
}

}  // namespace
}  // namespace wrenchd::test_workspace
