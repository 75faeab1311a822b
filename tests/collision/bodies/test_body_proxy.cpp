// SPDX-License-Identifier: GPL-3.0-or-later
#include <vector>

#include <catch2/catch.hpp>

#include "collision/bodies/body_placement.hpp"
#include "collision/bodies/body_proxy.hpp"
#include "collision/meshes/make_mesh.hpp"
#include "tests/support/no_allocation.hpp"

namespace wrenchd::test_body_proxy {

namespace {

constexpr double kTick_s = 1e-3;
constexpr double kStiffness_per_s2 = 3000.0;
constexpr double kFriction = 0.5;
constexpr double kMass_kg = 0.3;

ToolBody box(const Vector3d& size_m, double mass_kg) {
  return tool_body(make_mesh({"box", 12, 1, size_m}), 1.0, mass_kg);
}

FreeBody crate_at(const Vector3d& position_m) {
  FreeBody body;
  body.name = "crate";
  body.body = box(Vector3d::Constant(0.05), kMass_kg);
  body.motion.X_WB.translation_m = position_m;
  body.friction = kFriction;
  return body;
}

Scene plate(std::vector<FreeBody> bodies) {
  std::vector<MeshObstacle> obstacles;
  obstacles.emplace_back("plate", MeshBvh(make_mesh({"box", 12, 1, {0.6, 0.6, 0.02}})),
                         Pose{Quaterniond::Identity(), {0.0, 0.0, -0.01}});
  const Scene scene(box(Vector3d::Constant(0.02), 0.2), {}, {}, std::move(obstacles));
  MeshLoader loader;
  for (FreeBody& body : bodies) body.mesh = std::make_shared<const MeshBvh>(body.body.mesh, body.body.kind);
  return {scene, placed(std::move(bodies), scene, loader), {0.0, 0.0, -9.81}};
}

Pose at(double x_m, double z_m = 0.02) {
  Pose X;
  X.translation_m = {x_m, 0.0, z_m};
  return X;
}

TEST_CASE("the tool pushes a crate, and its answer is that of a proxy", "[body_proxy]") {
  const Scene scene = plate({crate_at({0.0, 0.0, 0.025})});
  BodyProxy proxy(scene, 0.0);
  double t_s = 0.0;
  for (int k = 0; k < 300; ++k) proxy.move_without_tool(t_s += kTick_s);
  REQUIRE(proxy.enter(at(-0.06), proxy.poses(), proxy.time_s()));
  // On the spring of the hand the crate swings about its steady motion, so the test takes the mean force.
  constexpr int kTicks = 1500, kSettled = 700;
  double work_J = 0.0, force_N = 0.0;
  Penetration last;
  const double start_m = proxy.poses()[0].translation_m.x();
  for (int k = 0; k < kTicks; ++k) {
    last = proxy.follow(at(-0.06 + 0.1 * kTick_s * k), kStiffness_per_s2, t_s += kTick_s);
    work_J += 0.5 * kStiffness_per_s2 * proxy.work_kg_m2();
    CHECK(last.projection.status != ProjectionStatus::infeasible);
    if (k >= kSettled) force_N += kStiffness_per_s2 * 0.2 * -last.eps.x() / (kTicks - kSettled);
  }
  CHECK(last.projection.status == ProjectionStatus::converged);
  CHECK(last.projection.kkt_residual < 1e-6);
  // The hand is ahead of the proxy by the stretch of the spring that overcomes the friction.
  CHECK(force_N == Approx(kFriction * kMass_kg * 9.81).epsilon(0.1));
  const double moved_m = proxy.poses()[0].translation_m.x() - start_m;
  CHECK(moved_m > 0.05);
  // The crate resists: its work on the tool is minus that of its friction, to the energy of its motion.
  CHECK(work_J == Approx(-kFriction * kMass_kg * 9.81 * moved_m).epsilon(0.1));
  const Touches touches = proxy.touches();
  REQUIRE(touches.size() > 0);
  CHECK(touches[0].obstacle == 1);
  CHECK(obstacle_name(scene, touches[0].obstacle) == "crate");
  CHECK(touches[0].normal_W[0] == Approx(-1.0).margin(1e-3));
}

TEST_CASE("a step of tool and bodies can be repeated for another pose of the hand", "[body_proxy]") {
  const Scene scene = plate({crate_at({0.0, 0.0, 0.025})});
  BodyProxy once(scene, 0.0), twice(scene, 0.0);
  for (BodyProxy* proxy : {&once, &twice}) REQUIRE(proxy->enter(at(-0.06), proxy->poses(), 0.0));
  for (int k = 1; k < 600; ++k) {
    const Pose p = at(-0.06 + 0.1 * kTick_s * k);
    const Penetration a = once.follow(p, kStiffness_per_s2, kTick_s * k);
    twice.follow(at(-0.06), kStiffness_per_s2, kTick_s * k);
    const Penetration b = twice.follow_again(p);
    INFO("tick " << k);
    CHECK((a.projection.X_WQ.translation_m - b.projection.X_WQ.translation_m).norm() < 1e-8);
    CHECK((once.poses()[0].translation_m - twice.poses()[0].translation_m).norm() < 1e-8);
  }
}

TEST_CASE("the tool does not enter where a body has moved since", "[body_proxy]") {
  FreeBody falls = crate_at({0.0, 0.0, 0.2});
  const Scene scene = plate({falls});
  BodyProxy proxy(scene, 0.0);
  const BodyPoses then = proxy.poses();
  CHECK(proxy.enter(at(0.0, 0.1), then, 0.0));
  BodyProxy later(scene, 0.0);
  for (int k = 1; k < 150; ++k) later.move_without_tool(kTick_s * k);
  CHECK(later.poses()[0].translation_m.z() < 0.12);
  CHECK_FALSE(later.enter(at(0.0, 0.1), then, 0.0));
  CHECK(later.enter(at(0.1, 0.1), then, 0.0));
}

TEST_CASE("a body at rest sleeps until the tool touches it", "[body_proxy]") {
  const Scene scene = plate({crate_at({0.0, 0.0, 0.025}), crate_at({0.0, 0.0, 0.075})});
  BodyWorld world(scene, scene.bodies(), {});
  for (int k = 0; k < 500; ++k) world.step(std::nullopt, kTick_s);
  REQUIRE(world.asleep(1));
  REQUIRE(world.asleep(2));
  BodyMotion tool;
  tool.X_WB = at(-0.06);
  world.place(0, tool);  // wakes
  for (int k = 0; k < 500; ++k) world.step(BodyWorld::Hand{at(-0.06), kStiffness_per_s2}, kTick_s);
  REQUIRE(world.asleep(1));
  int woke_at = -1;
  for (int k = 0; k < 600; ++k) {
    world.step(BodyWorld::Hand{at(-0.06 + 0.1 * kTick_s * k), kStiffness_per_s2}, kTick_s);
    if (woke_at < 0 && !world.asleep(1)) woke_at = k;
  }
  CHECK(woke_at == Approx(250).margin(3));  // the faces are 25 mm apart
  CHECK(world.motion(1).X_WB.translation_m.x() > 0.005);
}

TEST_CASE("bodies that overlap at the start are placed where they are free", "[body_proxy]") {
  const Scene scene = plate({crate_at({0.0, 0.0, 0.02}), crate_at({0.0, 0.0, 0.06})});
  CHECK(scene.bodies()[0].motion.X_WB.translation_m.z() == Approx(0.025).margin(1e-6));
  CHECK(scene.bodies()[1].motion.X_WB.translation_m.z() == Approx(0.075).margin(1e-6));
  const Scene obstacles = with_bodies_as_obstacles(scene);
  CHECK(obstacles.meshes().size() == 3);
  CHECK(obstacles.bodies().empty());
}

TEST_CASE("a tick of a body proxy does not allocate", "[body_proxy]") {
  const Scene scene = plate({crate_at({0.0, 0.0, 0.025})});
  BodyProxy proxy(scene, 0.3), other(scene, 0.3);
  REQUIRE(proxy.enter(at(-0.06), proxy.poses(), 0.0));
  const test::RealtimeGuard guard;
  for (int k = 1; k < 400; ++k) {
    proxy.follow(at(-0.06 + 0.2 * kTick_s * k), kStiffness_per_s2, kTick_s * k);
    proxy.follow_again(at(-0.06 + 0.2 * kTick_s * k));
    proxy.touches();
    proxy.work_kg_m2();
  }
  other.adopt(proxy);
  other.restart(0.0);
  CHECK(guard.allocations() == 0);
}

}  // namespace
}  // namespace wrenchd::test_body_proxy
