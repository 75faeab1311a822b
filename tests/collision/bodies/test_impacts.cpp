// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <catch2/catch.hpp>

#include "collision/bodies/body_world.hpp"
#include "collision/meshes/make_mesh.hpp"
#include "tests/support/exact_intersection.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_impacts {

namespace {

constexpr double kStep_s = 1e-3;
constexpr double kGravity_m_per_s2 = 9.81;

ToolBody box(const Vector3d& size_m, double mass_kg) {
  return tool_body(make_mesh({"box", 12, 1, size_m}), 1.0, mass_kg);
}

FreeBody body_at(const Vector3d& position_m, ToolBody shape, double restitution, double friction = 0.0) {
  FreeBody body;
  body.name = "body";
  body.body = std::move(shape);
  body.motion.X_WB.translation_m = position_m;
  body.friction = friction;
  body.restitution = restitution;
  return body;
}

/// A table at z = 0. The tool is away.
Scene table() {
  return Scene(box(Vector3d::Constant(0.05), 0.1), {HalfSpaceSettings{"table", Vector3d::UnitZ(), 0.0}});
}

BodyWorld::Settings weightless() {
  BodyWorld::Settings settings;
  settings.gravity_W_m_per_s2.setZero();
  return settings;
}

void step(BodyWorld& world) {
  REQUIRE(world.step(std::nullopt, kStep_s) == BodyWorld::Status::converged);
}

/// Height of the next peak of the path of body 1.
double next_peak_m(BodyWorld& world) {
  while (world.motion(1).velocity_W_m_per_s.z() <= 0.0) step(world);
  while (world.motion(1).velocity_W_m_per_s.z() > 0.0) step(world);
  return world.motion(1).X_WB.translation_m.z();
}

TEST_CASE("a dropped body rebounds to e^2 of its height, on a corner as on a face", "[impacts]") {
  const Scene scene = table();
  const double half_m = 0.025;
  for (const double e : {0.5, 0.8}) {
    BodyWorld world(scene, {body_at({0.0, 0.0, half_m + 0.5}, box(Vector3d::Constant(2.0 * half_m), 0.1), e)},
                    {});
    double height_m = 0.5;
    for (int bounce = 0; bounce < 3; ++bounce) {
      height_m *= e * e;
      INFO("e " << e << ", bounce " << bounce);
      CHECK(next_peak_m(world) - half_m == Approx(height_m).epsilon(0.005));
    }
    CHECK(world.motion(1).X_WB.rotation.angularDistance(Quaterniond::Identity()) < 1e-6);
  }
  // A corner below the centre of mass: the same law.
  FreeBody body = body_at({0.0, 0.0, 0.5}, box(Vector3d::Constant(2.0 * half_m), 0.1), 0.6);
  body.motion.X_WB.rotation = Quaterniond::FromTwoVectors(Vector3d::Ones(), Vector3d::UnitZ());
  BodyWorld world(scene, {body}, {});
  const double corner_m = half_m * std::numbers::sqrt3;
  CHECK(next_peak_m(world) - corner_m == Approx(0.36 * (0.5 - corner_m)).epsilon(0.005));
}

TEST_CASE("with e = 1 a body bounces for ten seconds, and its energy never rises", "[impacts]") {
  const Scene scene = table();
  BodyWorld world(scene, {body_at({0.0, 0.0, 0.225}, box(Vector3d::Constant(0.05), 0.1), 1.0)}, {});
  const double rest_J = 0.1 * kGravity_m_per_s2 * 0.025;
  const double start_J = world.energy_J();
  double energy_J = start_J;
  for (int k = 0; k < 10'000; ++k) {
    step(world);
    CHECK(world.energy_J() <= energy_J + 1e-12);
    energy_J = world.energy_J();
  }
  CHECK(energy_J - rest_J == Approx(start_J - rest_J).epsilon(0.002));
}

TEST_CASE("a body that hardly rebounds comes to rest, and falls asleep", "[impacts]") {
  const Scene scene = table();
  BodyWorld world(scene, {body_at({0.0, 0.0, 0.125}, box(Vector3d::Constant(0.05), 0.1), 0.4, 0.5)}, {});
  for (int k = 0; k < 1500; ++k) step(world);
  CHECK(world.asleep(1));
  CHECK(world.motion(1).X_WB.translation_m.z() == Approx(0.025).epsilon(1e-6));
}

TEST_CASE("two bodies that meet head-on satisfy the law of Newton and conserve momentum", "[impacts]") {
  const Scene scene(box(Vector3d::Constant(0.05), 0.1), {});
  for (const double e : {0.0, 0.3, 1.0}) {
    FreeBody light = body_at({-0.1, 0.0, 0.0}, box(Vector3d::Constant(0.05), 0.1), 0.0);
    FreeBody heavy = body_at({0.1, 0.0, 0.0}, box(Vector3d::Constant(0.06), 0.4), e);
    light.motion.velocity_W_m_per_s = {1.0, 0.0, 0.0};
    BodyWorld world(scene, {light, heavy}, weightless());
    for (int k = 0; k < 300; ++k) step(world);
    const double v1 = world.motion(1).velocity_W_m_per_s.x(), v2 = world.motion(2).velocity_W_m_per_s.x();
    INFO("e " << e);
    CHECK(0.1 * v1 + 0.4 * v2 == Approx(0.1).epsilon(1e-9));
    CHECK(v2 - v1 == Approx(e).margin(1e-6));
  }
}

TEST_CASE("a sphere that hits a wall at an angle leaves it as Newton's and Coulomb's laws tell",
          "[impacts]") {
  const double radius_m = 0.03, mass_kg = 0.1, e = 0.7;
  const ToolBody sphere = tool_body(make_mesh({"sphere", 5120}), 1.0, mass_kg);
  const double inertia_kg_m2 = sphere.solid.inertia.H_kg_m2(0, 0);
  // The rotation that a tangential impulse causes makes a point slower by this factor: 7/2 for a sphere
  const double lever = 1.0 + mass_kg * radius_m * radius_m / inertia_kg_m2;
  const Scene scene = table();
  for (const double mu : {0.05, 0.15, 0.9}) {
    FreeBody ball = body_at({0.0, 0.0, 0.1}, sphere, e, mu);
    ball.motion.velocity_W_m_per_s = {1.0, 0.0, -1.0};
    BodyWorld world(scene, {ball}, weightless());
    for (int k = 0; k < 150; ++k) step(world);
    const Vector3d& v = world.motion(1).velocity_W_m_per_s;
    const double slowed = std::min(mu * (1.0 + e), 1.0 / lever);  // slides, or ends to slip
    INFO("mu " << mu);
    CHECK(v.z() == Approx(e).epsilon(0.01));
    CHECK(v.x() == Approx(1.0 - slowed).epsilon(0.01));
    const double omega = angular_velocity_W(world.inertia(1), world.motion(1)).y();
    CHECK(omega == Approx(slowed * mass_kg * radius_m / inertia_kg_m2).epsilon(0.03));
  }
}

TEST_CASE("an obstacle that moves throws a body that falls on it", "[impacts]") {
  std::vector<MeshObstacle> obstacles;
  const double plate_m_per_s = 0.5, e = 0.5, half_m = 0.025;
  obstacles.emplace_back("plate", MeshBvh(make_mesh({"box", 12, 1, {0.4, 0.4, 0.02}})),
                         Pose{Quaterniond::Identity(), {0.0, 0.0, -0.01}},
                         ObstacleMotion{.linear_m_per_s = {0.0, 0.0, plate_m_per_s}});
  const Scene scene(box(Vector3d::Constant(0.05), 0.1), {}, {}, std::move(obstacles));
  for (int phase = 0; phase < 8; ++phase) {
    const double height_m = 0.1 + 2e-4 * phase;
    BodyWorld world(scene, {body_at({0.0, 0.0, half_m + height_m}, box(Vector3d::Constant(0.05), 0.1), e)},
                    {});
    // They meet where height = plate t + g t^2 / 2.
    const double g = kGravity_m_per_s2;
    const double meet_s = (std::sqrt(plate_m_per_s * plate_m_per_s + 2.0 * g * height_m) - plate_m_per_s) / g;
    int ticks = 0;
    while (world.motion(1).velocity_W_m_per_s.z() <= 0.0) {
      step(world);
      ++ticks;
    }
    INFO("phase " << phase);
    CHECK(ticks * kStep_s == Approx(meet_s).margin(kStep_s));
    CHECK(world.motion(1).velocity_W_m_per_s.z() ==
          Approx(plate_m_per_s + e * (plate_m_per_s + g * meet_s)).margin(5e-4));
  }
}

TEST_CASE("what hits the tool rebounds by the spring of the hand alone", "[impacts]") {
  const Scene scene = table();
  const auto after = [&](double restitution) {
    FreeBody body = body_at({0.0, 0.0, 0.2}, box(Vector3d::Constant(0.04), 0.1), restitution);
    body.motion.velocity_W_m_per_s = {0.0, 0.0, -1.0};
    BodyWorld world(scene, {body}, {});
    BodyWorld::Hand hand;
    hand.X_WP.translation_m = {0.0, 0.0, 0.1};
    hand.stiffness_per_s2 = 5000.0;
    BodyMotion tool;
    tool.X_WB = hand.X_WP;
    world.place(0, tool);
    for (int k = 0; k < 120; ++k) REQUIRE(world.step(hand, kStep_s) == BodyWorld::Status::converged);
    return world.motion(1);
  };
  const BodyMotion plain = after(0.0), elastic = after(0.9);
  CHECK((plain.X_WB.translation_m - elastic.X_WB.translation_m).norm() == 0.0);
}

TEST_CASE("bodies that rebound in a box gain no energy and overlap nothing, by exact arithmetic",
          "[impacts]") {
  const TriangleMesh cube = make_mesh({"box", 12, 1, Vector3d::Constant(0.05)});
  std::vector<HalfSpaceSettings> walls;
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {-1.0, 1.0})
      walls.push_back({"wall " + std::to_string(walls.size()), -side * Vector3d::Unit(axis), -0.12});
  const Scene scene(tool_body(cube, 1.0, 0.1), walls);
  test::RandomValues random(5);
  int impacts = 0;
  for (int run = 0; run < 6; ++run) {
    std::vector<FreeBody> bodies;
    for (int k = 0; k < 4; ++k) {
      const double side_m = k % 2 == 0 ? 0.05 : -0.05;
      bodies.push_back(body_at({side_m, k < 2 ? 0.05 : -0.05, 0.0},
                               tool_body(cube, 1.0, random.uniform(0.02, 2.0)), random.uniform(0.3, 1.0),
                               random.uniform(0.0, 1.0)));
      bodies.back().motion.X_WB.rotation = random.rotation();
      bodies.back().motion.velocity_W_m_per_s = random.vector<3>(2.0);
      set_angular_velocity_W(bodies.back().body.solid.inertia, random.vector<3>(20.0), bodies.back().motion);
    }
    BodyWorld world(scene, bodies, {});
    double energy_J = world.energy_J();
    Vector3d before = world.motion(1).velocity_W_m_per_s;
    const test::ExactIntersection pair(cube, cube);
    for (int tick = 0; tick < 1000; ++tick) {
      const BodyWorld::Status status = world.step(std::nullopt, kStep_s);
      INFO("run " << run << ", tick " << tick << ", contacts " << world.contacts().size());
      CHECK(status == BodyWorld::Status::converged);
      CHECK(world.energy_J() <= energy_J + 1e-6 * kStep_s);
      energy_J = world.energy_J();
      impacts += (world.motion(1).velocity_W_m_per_s - before).norm() > 0.2;
      before = world.motion(1).velocity_W_m_per_s;
      if (tick % 10 != 0) continue;
      for (std::size_t i = 1; i <= bodies.size(); ++i)
        for (std::size_t j = i + 1; j <= bodies.size(); ++j)
          CHECK_FALSE(pair.intersect(inverse(world.motion(j).X_WB) * world.motion(i).X_WB));
    }
  }
  CHECK(impacts > 60);
}

TEST_CASE("a step in which bodies rebound neither allocates nor locks", "[impacts]") {
  const Scene scene = table();
  BodyWorld world(scene, {body_at({0.0, 0.0, 0.05}, box(Vector3d::Constant(0.05), 0.1), 0.8, 0.3)}, {});
  const test::RealtimeGuard guard;
  for (int k = 0; k < 200; ++k) world.step(std::nullopt, kStep_s);
  CHECK(guard.allocations() == 0);
  CHECK(guard.locks() == 0);
  CHECK(world.motion(1).X_WB.translation_m.z() > 0.025);
}

}  // namespace
}  // namespace wrenchd::test_impacts
