// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <catch2/catch.hpp>

#include "collision/bodies/body_world.hpp"
#include "collision/meshes/make_mesh.hpp"
#include "core/energy_law.hpp"
#include "core/metric.hpp"
#include "tests/support/exact_intersection.hpp"
#include "tests/support/no_allocation.hpp"

namespace wrenchd::test_grasp {

namespace {

constexpr double kStep_s = 1e-3;
constexpr double kGravity_m_per_s2 = 9.81;
constexpr double kToolMass_kg = 0.1, kCrateMass_kg = 0.3;
constexpr double kStiffness_per_s2 = 20000.0;

ToolBody box(double edge_m, double mass_kg) {
  return tool_body(make_mesh({"box", 12, 1, Vector3d::Constant(edge_m)}), 1.0, mass_kg);
}

FreeBody crate(double mass_kg = kCrateMass_kg) {
  FreeBody body;
  body.name = "crate";
  body.body = box(0.05, mass_kg);
  body.motion.X_WB.translation_m = {0.0, 0.0, 0.025 + 1e-9};
  return body;
}

Scene table() {
  return Scene(box(0.02, kToolMass_kg), {HalfSpaceSettings{"table", Vector3d::UnitZ(), 0.0}});
}

/// A tool of 20 mm above a crate of 50 mm on a table, and the hand that moves it.
struct Hand {
  const Scene scene = table();
  BodyWorld world;
  BodyWorld::Hand hand{{}, kStiffness_per_s2};

  explicit Hand(const GraspStrength& strength = {}, double mass_kg = kCrateMass_kg)
      : world(scene, {crate(mass_kg)}, settings(strength)) {
    BodyMotion tool;
    tool.X_WB.translation_m = {0.0, 0.0, 0.0605};
    world.place(0, tool);
    hand.X_WP = tool.X_WB;
  }
  static BodyWorld::Settings settings(const GraspStrength& strength) {
    BodyWorld::Settings out;
    out.grasp = strength;
    return out;
  }

  void step() { CHECK(world.step(hand, kStep_s) == BodyWorld::Status::converged); }
  /// Moves the hand by this distance at a constant velocity.
  void move(const Vector3d& by_m, double seconds) {
    const int ticks = static_cast<int>(std::lround(seconds / kStep_s));
    const Vector3d start_m = hand.X_WP.translation_m;
    for (int k = 1; k <= ticks; ++k) {
      hand.X_WP.translation_m = start_m + static_cast<double>(k) / ticks * by_m;
      step();
    }
  }
  void touch_and_grasp() {
    move({0.0, 0.0, -0.0010}, 0.05);
    REQUIRE(world.grasp());
  }
  const Pose& X_WT() const { return world.motion(0).X_WB; }
  const Pose& X_WC() const { return world.motion(1).X_WB; }
  Wrench F_T() const { return energy_wrench(world.inertia(0), hand.stiffness_per_s2, hand.X_WP, X_WT()); }
  double spring_J() const { return 0.5 * kStiffness_per_s2 * energy(world.inertia(0), hand.X_WP, X_WT()); }
  bool overlaps() const {
    return test::ExactIntersection(scene.tool().mesh, crate().body.mesh).intersect(inverse(X_WC()) * X_WT());
  }
};

TEST_CASE("a tool that touches no body grasps none", "[grasp]") {
  Hand h;
  h.step();
  CHECK_FALSE(h.world.grasp());
  CHECK(h.world.held_body() == 0);
}

TEST_CASE("a held body stays where the tool holds it, and the hand feels its weight", "[grasp]") {
  Hand h;
  h.touch_and_grasp();
  CHECK(h.world.held_body() == 1);
  CHECK_FALSE(h.world.grasp());  // it has one
  const Pose X_TC = inverse(h.X_WT()) * h.X_WC();
  h.move({0.0, 0.0, 0.05}, 1.0);
  h.hand.X_WP.rotation = rotation_from({0.0, 0.0, 0.02});
  h.move({0.03, 0.02, 0.0}, 0.5);
  for (int k = 0; k < 20000; ++k) h.step();  // the crate swings below the tool meanwhile
  CHECK(log(inverse(X_TC) * (inverse(h.X_WT()) * h.X_WC())).norm() < 1e-12);
  CHECK(h.X_WC().translation_m.z() > 0.06);
  CHECK(h.F_T().force_N.z() == Approx(-kCrateMass_kg * kGravity_m_per_s2).epsilon(1e-4));
  CHECK(h.F_T().force_N.head<2>().norm() < 5e-3);
  CHECK_FALSE(h.overlaps());
}

TEST_CASE("a held body swings on the spring of the hand", "[grasp]") {
  Hand h;
  h.touch_and_grasp();
  h.move({0.0, 0.0, 0.1}, 1.0);
  for (int k = 0; k < 3000; ++k) h.step();  // the scheme damps the swing
  const double low_m = h.X_WT().translation_m.z();
  h.hand.X_WP.translation_m.z() += 0.002;
  std::vector<int> crossings;  // of where it comes to rest
  double last_m = -1.0;
  for (int k = 0; k < 400; ++k) {
    h.step();
    const double z_m = h.X_WT().translation_m.z() - low_m - 0.002;
    if (last_m * z_m < 0.0) crossings.push_back(k);
    last_m = z_m;
  }
  REQUIRE(crossings.size() >= 4);
  // k of the law times the mass of the tool is the spring, and the crate the mass that swings.
  const double half_period_s = std::numbers::pi / std::sqrt(kStiffness_per_s2 * kToolMass_kg / kCrateMass_kg);
  CHECK(kStep_s * (crossings[2] - crossings[0]) == Approx(2.0 * half_period_s).epsilon(0.03));
}

TEST_CASE("a held body does not enter an obstacle, and the hand feels it", "[grasp]") {
  Hand h;
  h.touch_and_grasp();
  h.move({0.0, 0.0, 0.02}, 0.3);
  h.move({0.0, 0.0, -0.0235}, 0.3);
  for (int k = 0; k < 500; ++k) h.step();
  CHECK(h.X_WC().translation_m.z() >= 0.025);
  CHECK(h.X_WC().translation_m.z() == Approx(0.025).margin(1e-6));
  // The table carries the weight and the pressure of the hand.
  const double stretch_m = h.X_WT().translation_m.z() - h.hand.X_WP.translation_m.z();
  CHECK(stretch_m > 0.001);
  double table_N = 0.0;
  for (const BodyContact& c : h.world.contacts()) table_N += c.force_W_N.z();
  CHECK(
      table_N ==
      Approx(kCrateMass_kg * kGravity_m_per_s2 + kStiffness_per_s2 * kToolMass_kg * stretch_m).epsilon(1e-6));
}

TEST_CASE("a tool lets go without a jump of the wrench, and the body falls", "[grasp]") {
  Hand h;
  h.touch_and_grasp();
  h.move({0.0, 0.0, 0.1}, 1.0);
  for (int k = 0; k < 3000; ++k) h.step();
  double force_N = h.F_T().force_N.z(), largest_N = 0.0;
  CHECK(force_N < -2.9);
  const double top_m = h.X_WC().translation_m.z();
  h.world.let_go();
  constexpr int kTicks = 150;
  for (int k = 0; k < kTicks; ++k) {
    h.step();
    largest_N = std::max(largest_N, std::abs(h.F_T().force_N.z() - force_N));
    force_N = h.F_T().force_N.z();
  }
  CHECK(largest_N < 3.0 / kTicks);
  CHECK(std::abs(force_N) < 1e-9);
  CHECK(h.X_WC().translation_m.z() - top_m < -0.07);
  CHECK(h.world.held_body() == 0);
  CHECK_FALSE(h.overlaps());
}

TEST_CASE("a grasp breaks under a load that is larger than its strength, but not in an impact", "[grasp]") {
  Hand weak({1.0, 1.0});
  weak.touch_and_grasp();
  bool broke = false;
  for (int k = 0; k < 200 && !broke; ++k) {
    weak.hand.X_WP.translation_m.z() += 5e-5;
    weak.step();
    broke = weak.world.grasp_broke();
  }
  CHECK(broke);
  CHECK(weak.world.held_body() == 0);

  Hand strong({6.0, 2.0});
  strong.touch_and_grasp();
  strong.move({0.0, 0.0, 0.02}, 0.5);
  strong.move({0.0, 0.0, -0.0205}, 0.2);  // onto the table: 0.03 N s
  CHECK(strong.world.held_body() == 1);
}

/// METHOD (68), (111): the hand's work is what the spring stores less what bodies do on the tool.
TEST_CASE("neither grasp nor release is a source of energy", "[grasp]") {
  Hand h;
  h.move({0.0, 0.0, -0.001}, 0.1);
  double hand_J = 0.0, bodies_J = 0.0, most_J = 0.0;
  Vector3d before_m = h.hand.X_WP.translation_m, force_before_N = h.F_T().force_N;
  const double start_J = h.world.energy_J(), spring_start_J = h.spring_J();
  const auto count = [&] {
    const Vector3d force_N = h.F_T().force_N;
    hand_J += -0.5 * (force_N + force_before_N).dot(h.hand.X_WP.translation_m - before_m);
    bodies_J += h.world.work_on_tool_J();
    before_m = h.hand.X_WP.translation_m;
    force_before_N = force_N;
    most_J = std::max(most_J, h.world.energy_J() - start_J + h.spring_J() - spring_start_J - hand_J);
  };
  for (int k = 0; k < 4000; ++k) {
    const double t_s = k * kStep_s;
    h.hand.X_WP.translation_m = {0.01 * std::sin(4.0 * t_s), 0.0,
                                 0.0595 + 0.02 * (1.0 - std::cos(3.0 * t_s))};
    h.world.step(h.hand, kStep_s);
    count();
    if (k == 5) REQUIRE(h.world.grasp());
    if (k == 1200 || k == 3000) h.world.let_go();
    if (k > 2000) h.world.grasp();
  }
  CHECK(bodies_J + hand_J == Approx(h.spring_J() - spring_start_J).margin(1e-6));
  CHECK(most_J < 1e-7);
}

TEST_CASE("a step with a grasp can be taken back, and allocates nothing", "[grasp]") {
  Hand h;
  h.touch_and_grasp();
  h.move({0.0, 0.0, 0.01}, 0.1);
  const test::RealtimeGuard guard;
  h.world.step(h.hand, kStep_s);
  const Pose once = h.X_WC();
  h.world.take_back();
  h.world.step(h.hand, kStep_s);
  CHECK(same_bits(once, h.X_WC()));
  h.world.take_back();
  h.world.let_go();
  h.world.step(h.hand, kStep_s);
  h.world.take_back();
  CHECK(h.world.held_body() == 0);
  CHECK(h.world.grasp() == false);  // the tool has moved on
  CHECK(guard.allocations() == 0);
  CHECK(guard.locks() == 0);
}

}  // namespace
}  // namespace wrenchd::test_grasp
