// SPDX-License-Identifier: GPL-3.0-or-later
// Two hands in one BodyWorld: each leads a tool, and the steps name them in turn.
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include <catch2/catch.hpp>

#include "collision/bodies/body_world.hpp"
#include "collision/meshes/make_mesh.hpp"
#include "core/energy_law.hpp"
#include "core/metric.hpp"
#include "tests/support/exact_intersection.hpp"
#include "tests/support/no_allocation.hpp"

namespace wrenchd::test_two_tools {

namespace {

constexpr double kTick_s = 1e-3;  // of each hand; the hands take turns
constexpr double kGravity_m_per_s2 = 9.81;
constexpr double kToolMass_kg = 0.1, kPlateMass_kg = 0.4;
constexpr double kStiffness_per_s2 = 20000.0;

ToolBody box(const Vector3d& edges_m, double mass_kg) {
  return tool_body(make_mesh({"box", 12, 1, edges_m}), 1.0, mass_kg);
}

/// A cube of 20 mm with the moments of inertia of a larger body: a small light tool that is pressed far from
/// its hand topples, and T is not convex there.
ToolBody tool() {
  ToolBody out = box(Vector3d::Constant(0.02), kToolMass_kg);
  out.solid.inertia.H_kg_m2 *= 30.0;
  return out;
}

FreeBody plate_at(const Vector3d& position_m) {
  FreeBody body;
  body.name = "plate";
  body.body = box({0.1, 0.06, 0.02}, kPlateMass_kg);
  body.motion.X_WB.translation_m = position_m;
  body.friction = 0.8;
  return body;
}

FreeBody second_tool(double friction) {
  FreeBody body;
  body.name = "second tool";
  body.body = tool();
  body.friction = friction;
  body.of_hand = true;
  return body;
}

std::vector<FreeBody> bodies_of(bool with_plate, double friction) {
  std::vector<FreeBody> out;
  if (with_plate) out.push_back(plate_at({0.0, 0.0, 0.01 + 1e-9}));
  out.push_back(second_tool(friction));
  return out;
}

/// Two tools of 20 mm, left and right of a plate on a table, or above it.
struct TwoTools {
  const Scene scene = Scene(tool(), {HalfSpaceSettings{"table", Vector3d::UnitZ(), 0.0}});
  BodyWorld world;
  std::array<BodyWorld::Hand, 2> hands;
  double dissipated_J = 0.0, gained_J = 0.0;
  std::uint64_t allocations = 0;
  bool with_plate;

  explicit TwoTools(const std::array<Vector3d, 2>& start_m, bool plate = true, double friction = 0.8)
      : world(scene, bodies_of(plate, friction), settings(friction)), with_plate(plate) {
    for (std::size_t i = 0; i < 2; ++i) {
      hands[i] = {Pose{Quaterniond::Identity(), start_m[i]}, kStiffness_per_s2};
      world.enter_tool(i, hands[i].X_WP);
    }
  }
  static BodyWorld::Settings settings(double friction) {
    BodyWorld::Settings out;
    out.tool_friction = friction;
    out.grasp = {1e3, 1e3};  // no grasp breaks
    return out;
  }
  const Pose& X_WT(std::size_t i) const { return world.motion(world.body_of(i)).X_WB; }
  const Pose& X_WB() const { return world.motion(1).X_WB; }
  Wrench F_T(std::size_t i) const {
    return energy_wrench(world.inertia(world.body_of(i)), kStiffness_per_s2, hands[i].X_WP, X_WT(i));
  }
  double spring_J(std::size_t i) const {
    return 0.5 * kStiffness_per_s2 * energy(world.inertia(world.body_of(i)), hands[i].X_WP, X_WT(i));
  }
  double stored_J() const { return spring_J(0) + spring_J(1) + world.energy_J(); }

  /// One step of a hand: adds up by how much it changes the energy of springs and bodies.
  void step(std::size_t i) {
    const double before_J = stored_J();
    {
      const test::RealtimeGuard guard;
      world.step(hands[i], kTick_s / 2.0, world.time_s() + kTick_s / 2.0, i);
      allocations += guard.allocations();
    }
    const double change_J = stored_J() - before_J;
    (change_J > 0.0 ? gained_J : dissipated_J) += std::abs(change_J);
  }
  /// Moves both hands at constant velocities.
  void move(const Vector3d& first_m, const Vector3d& second_m, double seconds) {
    const int ticks = static_cast<int>(std::lround(seconds / kTick_s));
    const std::array<Vector3d, 2> by_m = {first_m, second_m};
    for (int k = 0; k < ticks; ++k)
      for (std::size_t i = 0; i < 2; ++i) {
        hands[i].X_WP.translation_m += by_m[i] / ticks;
        step(i);
      }
  }
  bool any_overlap() const {
    const TriangleMesh& mesh = scene.tool().mesh;
    if (test::ExactIntersection(mesh, mesh).intersect(inverse(X_WT(1)) * X_WT(0))) return true;
    if (!with_plate) return false;
    const test::ExactIntersection plate(mesh, plate_at(Vector3d::Zero()).body.mesh);
    return plate.intersect(inverse(X_WB()) * X_WT(0)) || plate.intersect(inverse(X_WB()) * X_WT(1));
  }
};

const std::array<Vector3d, 2> kBeside = {Vector3d(-0.0605, 0.0, 0.0101), Vector3d(0.0605, 0.0, 0.0101)};
const std::array<Vector3d, 2> kAbove = {Vector3d(-0.035, 0.0, 0.0305), Vector3d(0.035, 0.0, 0.0305)};
const Vector3d kZero = Vector3d::Zero();

/// Both hands touch the plate from above, grasp it and lift it by 50 mm.
void lift_together(TwoTools& h) {
  h.move({0.0, 0.0, -0.001}, {0.0, 0.0, -0.001}, 0.05);
  REQUIRE(h.world.grasp(0));
  REQUIRE(h.world.grasp(1));
  h.move({0.0, 0.0, 0.05}, {0.0, 0.0, 0.05}, 1.0);
}

}  // namespace

TEST_CASE("two hands squeeze a plate and carry it by friction", "[two_tools]") {
  TwoTools h(kBeside);
  h.move({0.003, 0.0, 0.0}, {-0.003, 0.0, 0.0}, 0.2);
  h.move({0.0, 0.0, 0.05}, {0.0, 0.0, 0.05}, 1.0);
  h.move({0.0, 0.03, 0.0}, {0.0, 0.03, 0.0}, 1.0);
  h.move(kZero, kZero, 1.0);
  CHECK(h.X_WB().translation_m.z() > 0.055);
  CHECK(h.X_WB().translation_m.y() == Approx(0.03).margin(1e-3));
  for (const std::size_t i : {0U, 1U})
    CHECK(h.F_T(i).force_N.z() == Approx(-0.5 * kPlateMass_kg * kGravity_m_per_s2).epsilon(0.02));
  CHECK(h.F_T(0).force_N.x() == Approx(-h.F_T(1).force_N.x()).epsilon(0.01));
  CHECK_FALSE(h.any_overlap());
  CHECK(h.gained_J < 4e-6);  // less than 1 uJ/s
}

TEST_CASE("two hands hold one plate and share its weight", "[two_tools]") {
  TwoTools h(kAbove);
  lift_together(h);
  CHECK(h.world.held_body(0) == 1);
  CHECK(h.world.held_body(1) == 1);
  const Pose X_AB = inverse(h.X_WT(0)) * h.X_WT(1);
  h.move(kZero, kZero, 3.0);
  CHECK(h.X_WB().translation_m.z() > 0.055);
  for (const std::size_t i : {0U, 1U}) {
    CHECK(h.F_T(i).force_N.z() == Approx(-0.5 * kPlateMass_kg * kGravity_m_per_s2).epsilon(1e-3));
    CHECK(h.world.tool_load_W(i).force_N.z() ==
          Approx(-0.5 * kPlateMass_kg * kGravity_m_per_s2).epsilon(1e-3));
  }
  // Each hand feels the pull of the other through the plate.
  h.move({0.0, -0.002, 0.0}, {0.0, 0.002, 0.0}, 0.2);
  h.move({-0.002, 0.0, 0.0}, {0.002, 0.0, 0.0}, 0.2);
  h.move(kZero, kZero, 2.0);
  CHECK(h.F_T(0).force_N.x() > 1.0);
  CHECK(h.F_T(0).force_N.x() == Approx(-h.F_T(1).force_N.x()).epsilon(1e-3));
  CHECK(log(inverse(X_AB) * (inverse(h.X_WT(0)) * h.X_WT(1))).norm() < 1e-12);  // one rigid body
  CHECK(h.gained_J < 6e-6);
}

TEST_CASE("a plate changes hands without a jump", "[two_tools]") {
  TwoTools h(kAbove);
  lift_together(h);
  h.move(kZero, kZero, 2.0);
  h.world.let_go(0);
  CHECK(h.world.held_body(0) == 0);
  double last_N = h.F_T(1).force_N.z(), largest_change_N = 0.0, largest_step_m = 0.0, sum_N = 0.0;
  Pose last = h.X_WB();
  for (int k = 0; k < 4000; ++k) {
    h.move(kZero, kZero, kTick_s);
    largest_change_N = std::max(largest_change_N, std::abs(h.F_T(1).force_N.z() - last_N));
    largest_step_m = std::max(largest_step_m, (h.X_WB().translation_m - last.translation_m).norm());
    last_N = h.F_T(1).force_N.z();
    last = h.X_WB();
    if (k >= 2000) sum_N += last_N / 2000.0;
  }
  CHECK(largest_step_m < 1e-3);  // the plate now hangs from one hand: it turns about that tool
  CHECK(largest_change_N < 0.5);
  CHECK(sum_N == Approx(-kPlateMass_kg * kGravity_m_per_s2).epsilon(0.02));
  h.move({-0.05, 0.0, 0.05}, kZero, 0.5);  // the first hand leaves
  CHECK(h.F_T(0).force_N.norm() < 1e-9);
  CHECK(h.world.held_body(1) == 1);
  CHECK_FALSE(h.any_overlap());
}

TEST_CASE("two tools press on each other, and work passes from one hand to the other", "[two_tools]") {
  TwoTools h({Vector3d(-0.02, 0.0, 0.05), Vector3d(0.02, 0.0, 0.05)}, false, 0.0);
  double on_first_J = 0.0, on_second_J = 0.0;
  std::array<double, 2> by_hand_J{};  // what each hand does by moving its pose
  const auto move_hand = [&](std::size_t i, const Vector3d& by_m) {
    const double before_J = h.spring_J(i);
    h.hands[i].X_WP.translation_m += by_m;
    by_hand_J[i] += h.spring_J(i) - before_J;
    h.step(i);
  };
  const auto move = [&](const Vector3d& first_m, const Vector3d& second_m, double seconds) {
    const int ticks = static_cast<int>(std::lround(seconds / kTick_s));
    for (int k = 0; k < ticks; ++k) {
      move_hand(0, first_m / ticks);
      on_first_J += h.world.work_on_tool_J(0);
      move_hand(1, second_m / ticks);
      on_second_J += h.world.work_on_tool_J(1);
    }
  };
  move({0.013, 0.0, 0.0}, {-0.013, 0.0, 0.0}, 0.2);
  move(kZero, kZero, 0.01);
  CHECK(h.F_T(0).force_N.x() < -1.0);
  CHECK(h.F_T(0).force_N.x() == Approx(-h.F_T(1).force_N.x()).epsilon(1e-6));
  on_first_J = on_second_J = 0.0;
  by_hand_J = {};
  const double before_J = h.spring_J(0), second_before_J = h.spring_J(1);
  move({0.02, 0.0, 0.0}, {0.02, 0.0, 0.0}, 1.0);  // the first hand pushes the second one along
  move(kZero, kZero, 0.01);
  CHECK(on_second_J > 0.01);
  CHECK(std::abs(on_first_J + on_second_J) < 1e-6);
  CHECK(h.spring_J(0) == Approx(before_J).epsilon(1e-3));
  // A step dissipates the square of what the pose moved in it: 0.2 mJ in all.
  CHECK(h.spring_J(0) - before_J == Approx(by_hand_J[0] + on_first_J).margin(5e-4));
  CHECK(h.spring_J(1) - second_before_J == Approx(by_hand_J[1] + on_second_J).margin(5e-4));
  CHECK_FALSE(h.any_overlap());
}

TEST_CASE("a tool that is out of the world is in nobody's way, and enters where there is room",
          "[two_tools]") {
  TwoTools h({Vector3d(-0.02, 0.0, 0.05), Vector3d(0.02, 0.0, 0.05)}, false, 0.0);
  h.world.remove_tool(1);
  CHECK_FALSE(h.world.has_hand(1));
  for (int k = 0; k < 100; ++k) {
    h.hands[0].X_WP.translation_m.x() += 0.0004;
    h.step(0);
  }
  CHECK(h.X_WT(0).translation_m.x() == Approx(0.02).margin(1e-9));
  CHECK(h.F_T(0).force_N.norm() == 0.0);
  // The first tool was far away when the pose of the second one was found, and is in it now.
  const std::vector<Pose> far_away = {Pose{Quaterniond::Identity(), {0.0, 0.0, -1000.0}}};
  CHECK_FALSE(h.world.admits_tool(Pose{Quaterniond::Identity(), {0.02, 0.0, 0.05}}, far_away, 0.0, 1));
  CHECK(h.world.admits_tool(Pose{Quaterniond::Identity(), {0.08, 0.0, 0.05}}, far_away, 0.0, 1));
}

TEST_CASE("a hand that leaves lets go; the other one keeps the plate", "[two_tools]") {
  TwoTools h(kAbove);
  lift_together(h);
  h.world.remove_tool(0);
  double mean_N = 0.0;
  for (int k = 0; k < 8000; ++k) {
    h.step(1);
    if (k >= 4000) mean_N += h.F_T(1).force_N.z() / 4000.0;
  }
  CHECK(h.world.held_body(0) == 0);
  CHECK(h.world.held_body(1) == 1);
  CHECK(mean_N == Approx(-kPlateMass_kg * kGravity_m_per_s2).epsilon(0.02));
}

TEST_CASE("random motions of two hands: no overlap, no energy from the scheme, no allocation",
          "[two_tools]") {
  const auto seed = GENERATE(range(1U, 9U));
  TwoTools h(seed % 2 == 0 ? kBeside : kAbove);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> share(-1.0, 1.0);
  int grasps = 0;
  for (int round = 0; round < 40; ++round) {
    const auto towards = [&](std::size_t i) {
      const Vector3d centre_m(i == 0 ? -0.04 : 0.04, 0.0, 0.03);
      const Vector3d goal_m =
          centre_m + Vector3d(0.04 * share(random), 0.03 * share(random), 0.02 * share(random));
      return Vector3d(goal_m - h.hands[i].X_WP.translation_m);
    };
    for (std::size_t i = 0; i < 2; ++i) {
      h.hands[i].X_WP.rotation = rotation_from(0.2 * Vector3d(share(random), share(random), share(random)));
      h.step(i);
    }
    const Vector3d first_m = towards(0), second_m = towards(1);
    h.move(first_m, second_m, 0.1);
    for (std::size_t i = 0; i < 2; ++i) {
      if (round % 4 == 1) grasps += h.world.grasp(i) ? 1 : 0;
      if (round % 4 == 3 && share(random) > 0.0) h.world.let_go(i);
    }
    if (round % 4 == 3) {  // on the way back to its hand a tool has another energy than that of its spring
      const double gained_J = h.gained_J;
      h.move(kZero, kZero, 0.2);
      h.gained_J = gained_J;
    }
    if (h.any_overlap()) FAIL("overlap in round " << round);
  }
  CHECK(h.gained_J < 4e-6);
  CHECK(h.dissipated_J > 0.0);
  CHECK(h.allocations == 0);
}

}  // namespace wrenchd::test_two_tools
