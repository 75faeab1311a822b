// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>
#include <vector>

#include <catch2/catch.hpp>

#include "collision/bodies/body_world.hpp"
#include "collision/meshes/make_mesh.hpp"
#include "collision/proxy.hpp"
#include "core/energy_law.hpp"
#include "core/metric.hpp"
#include "tests/support/exact_intersection.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_body_world {

namespace {

constexpr double kStep_s = 1e-3;
constexpr double kGravity_m_per_s2 = 9.81;

ToolBody box(const Vector3d& size_m, double mass_kg = 0.1) {
  return tool_body(make_mesh({"box", 12, 1, size_m}), 1.0, mass_kg);
}
ToolBody cube() {
  return box(Vector3d::Constant(0.05));
}

FreeBody body_at(const Vector3d& position_m, ToolBody shape, double friction = 0.5) {
  FreeBody body;
  body.name = "body";
  body.body = std::move(shape);
  body.motion.X_WB.translation_m = position_m;
  body.friction = friction;
  return body;
}

/// A table at z = 0, and a cube of 50 mm as the tool.
Scene table() {
  return Scene(cube(), {HalfSpaceSettings{"table", Vector3d::UnitZ(), 0.0}});
}

/// A table that is inclined about y: gravity is turned instead.
BodyWorld::Settings inclined(double angle_rad) {
  BodyWorld::Settings settings;
  settings.gravity_W_m_per_s2 = kGravity_m_per_s2 * Vector3d(std::sin(angle_rad), 0.0, -std::cos(angle_rad));
  return settings;
}

int run(BodyWorld& world, double seconds) {
  int unfinished = 0;
  for (int k = 0; k < static_cast<int>(std::lround(seconds / kStep_s)); ++k)
    unfinished += world.step(std::nullopt, kStep_s) != BodyWorld::Status::converged;
  return unfinished;
}

TEST_CASE("a body lies on a slope below the angle of friction and slides above it", "[body_world]") {
  const Scene scene = table();
  const double limit = std::atan(0.5);
  for (const double direction : {0.0, 0.3}) {  // of the cube on the table
    FreeBody body = body_at({0.0, 0.0, 0.025 + 1e-9}, cube());
    body.motion.X_WB.rotation = rotation_from({0.0, 0.0, direction});
    BodyWorld below(scene, {body}, inclined(0.995 * limit)), above(scene, {body}, inclined(1.005 * limit));
    CHECK(run(below, 2.0) + run(above, 2.0) == 0);
    CHECK(below.motion(1).X_WB.translation_m.norm() < 0.025 + 1e-8);
    // a = g (sin - mu cos)
    const double acceleration = kGravity_m_per_s2 * (std::sin(1.005 * limit) - 0.5 * std::cos(1.005 * limit));
    CHECK(above.motion(1).velocity_W_m_per_s.x() == Approx(2.0 * acceleration).epsilon(0.005));
    CHECK(std::abs(above.motion(1).velocity_W_m_per_s.y()) < 1e-6);
  }
}

TEST_CASE("a sliding body stops after v^2 / (2 mu g)", "[body_world]") {
  const Scene scene = table();
  for (const double angle : {0.0, 0.5, 1.1}) {
    FreeBody body = body_at({0.0, 0.0, 0.025 + 1e-9}, cube(), 0.3);
    body.motion.velocity_W_m_per_s = Vector3d(std::cos(angle), std::sin(angle), 0.0);
    BodyWorld world(scene, {body}, {});
    CHECK(run(world, 1.0) == 0);
    const Vector3d moved = world.motion(1).X_WB.translation_m - body.motion.X_WB.translation_m;
    CHECK(moved.norm() == Approx(1.0 / (2.0 * 0.3 * kGravity_m_per_s2)).epsilon(0.01));
    CHECK(std::abs(std::atan2(moved.y(), moved.x()) - angle) < 1e-3);
    CHECK(world.motion(1).velocity_W_m_per_s.norm() < 1e-9);
  }
}

TEST_CASE("a block topples at the angle at which its centre passes the edge", "[body_world]") {
  const Scene scene = table();
  const double limit = std::atan(0.02 / 0.06);
  const FreeBody body = body_at({0.0, 0.0, 0.03 + 1e-9}, box({0.02, 0.02, 0.06}), 1.0);
  BodyWorld below(scene, {body}, inclined(0.995 * limit)), above(scene, {body}, inclined(1.005 * limit));
  run(below, 2.0);
  run(above, 2.0);
  CHECK(below.motion(1).X_WB.rotation.angularDistance(Quaterniond::Identity()) < 1e-6);
  CHECK(above.motion(1).X_WB.rotation.angularDistance(Quaterniond::Identity()) > 0.5);
}

TEST_CASE("a stack stays for a minute without drift", "[body_world]") {
  const Scene scene = table();
  std::vector<FreeBody> bodies;
  for (int k = 0; k < 3; ++k) bodies.push_back(body_at({0.003 * k, 0.0, 0.0251 + 0.0501 * k}, cube()));
  BodyWorld world(scene, bodies, {});
  REQUIRE(run(world, 0.1) == 0);
  std::vector<Pose> landed;
  for (std::size_t i = 1; i <= 3; ++i) landed.push_back(world.motion(i).X_WB);
  CHECK(run(world, 60.0) == 0);
  for (std::size_t i = 1; i <= 3; ++i) {
    CHECK((world.motion(i).X_WB.translation_m - landed[i - 1].translation_m).norm() < 1e-9);
    CHECK(world.motion(i).X_WB.rotation.angularDistance(landed[i - 1].rotation) < 1e-7);
  }
  CHECK(world.motion(3).X_WB.translation_m.z() == Approx(0.125).epsilon(1e-6));
}

TEST_CASE("a collision conserves momentum and creates no energy", "[body_world]") {
  const Scene scene(cube(), {});
  test::RandomValues random(3);
  for (int k = 0; k < 20; ++k) {
    std::vector<FreeBody> bodies = {body_at({-0.06, 0.0, 0.0}, cube()),
                                    body_at({0.06, 0.01, 0.0}, box({0.04, 0.05, 0.06}, 0.25))};
    for (FreeBody& body : bodies) body.motion.X_WB.rotation = random.rotation();
    bodies[0].motion.velocity_W_m_per_s = {1.0, 0.1, 0.0};
    bodies[1].motion.velocity_W_m_per_s = {-0.5, 0.0, 0.1};
    BodyWorld::Settings weightless;
    weightless.gravity_W_m_per_s2.setZero();
    BodyWorld world(scene, bodies, weightless);
    const auto momentum = [&] {
      return Vector3d(0.1 * world.motion(1).velocity_W_m_per_s + 0.25 * world.motion(2).velocity_W_m_per_s);
    };
    const Vector3d before = momentum();
    double energy_J = world.energy_J();
    const double start_J = energy_J;
    for (int tick = 0; tick < 200; ++tick) {
      REQUIRE(world.step(std::nullopt, kStep_s) == BodyWorld::Status::converged);
      CHECK(world.energy_J() <= energy_J + 1e-9);
      energy_J = world.energy_J();
    }
    INFO("pair " << k);
    CHECK(energy_J < 0.9 * start_J);  // they met
    CHECK((momentum() - before).norm() < 1e-9 * before.norm());
  }
}

TEST_CASE("bodies that fall on each other overlap nothing, by exact arithmetic, and gain no energy",
          "[body_world]") {
  const TriangleMesh rock = make_mesh({"boulder", 300, 4, {}});
  const ToolBody stone = tool_body(rock, 1.0, 0.3), cube_body = cube();
  const TriangleMesh plate = make_mesh({"box", 12, 1, {0.4, 0.4, 0.02}});
  std::vector<MeshObstacle> obstacles;
  const Pose X_WPlate = {Quaterniond::Identity(), {0.0, 0.0, -0.01}};
  obstacles.emplace_back("plate", MeshBvh(plate), X_WPlate);
  const Scene scene(cube(), {}, {}, std::move(obstacles));
  test::RandomValues random(11);
  std::vector<FreeBody> bodies;
  for (int k = 0; k < 4; ++k) {
    bodies.push_back(body_at({random.uniform(-0.03, 0.03), random.uniform(-0.03, 0.03), 0.08 + 0.12 * k},
                             k % 2 == 0 ? stone : cube_body));
    bodies.back().motion.X_WB.rotation = random.rotation();
    set_angular_velocity_W(bodies.back().body.solid.inertia, random.vector<3>(5.0), bodies.back().motion);
  }
  BodyWorld world(scene, bodies, {});
  const auto mesh_of = [&](std::size_t i) -> const TriangleMesh& { return bodies[i - 1].body.mesh; };
  double energy_J = world.energy_J();
  std::size_t most_contacts = 0;
  int unfinished = 0;
  for (int tick = 0; tick < 1500; ++tick) {
    unfinished += world.step(std::nullopt, kStep_s) != BodyWorld::Status::converged;
    most_contacts = std::max(most_contacts, world.contacts().size());
    CHECK(world.energy_J() <= energy_J + 1e-9);
    energy_J = world.energy_J();
    if (tick % 10 != 0) continue;
    for (std::size_t i = 1; i <= bodies.size(); ++i) {
      const Pose X_WB = world.motion(i).X_WB;
      INFO("tick " << tick << ", body " << i);
      CHECK_FALSE(test::ExactIntersection(mesh_of(i), plate).intersect(inverse(X_WPlate) * X_WB));
      for (std::size_t j = i + 1; j <= bodies.size(); ++j)
        CHECK_FALSE(
            test::ExactIntersection(mesh_of(i), mesh_of(j)).intersect(inverse(world.motion(j).X_WB) * X_WB));
    }
  }
  CHECK(most_contacts >= 6);
  CHECK(unfinished == 0);
}

TEST_CASE("the tool pushes a body, and the hand feels its friction", "[body_world]") {
  const Scene scene = table();
  const FreeBody body = body_at({0.06, 0.0, 0.025 + 1e-9}, cube(), 0.4);
  BodyWorld world(scene, {body}, {});
  BodyMotion tool;
  tool.X_WB.translation_m = {0.0, 0.0, 0.03};
  world.place(0, tool);
  BodyWorld::Hand hand = {tool.X_WB, 5000.0};
  // On the spring of the hand the body swings about its steady motion, so the test takes means.
  constexpr int kTicks = 1000, kSettled = 500;
  double force_N = 0.0, settled_m = 0.0;
  for (int k = 0; k < kTicks; ++k) {
    hand.X_WP.translation_m.x() = 0.05 * k * kStep_s;  // 50 mm/s
    REQUIRE(world.step(hand, kStep_s) == BodyWorld::Status::converged);
    const Pose& X_WQ = world.motion(0).X_WB;
    CHECK(world.motion(1).X_WB.translation_m.x() - X_WQ.translation_m.x() >= 0.05);
    if (k == kSettled) settled_m = world.motion(1).X_WB.translation_m.x();
    if (k < kSettled) continue;
    const Wrench F_T = energy_wrench(world.inertia(0), hand.stiffness_per_s2, hand.X_WP, X_WQ);
    force_N += F_T.force_N.x() / (kTicks - kSettled);
  }
  CHECK(force_N == Approx(-0.4 * 0.1 * kGravity_m_per_s2).epsilon(0.03));
  const double moved_m = world.motion(1).X_WB.translation_m.x() - settled_m;
  CHECK(moved_m == Approx(0.05 * (kTicks - kSettled) * kStep_s).epsilon(0.03));
}

TEST_CASE("friction does not vanish where a tool presses bodies aside", "[body_world]") {
  const Scene scene = table();
  test::RandomValues random(3);
  std::size_t loaded = 0, frictionless = 0, unfinished = 0;
  for (int run = 0; run < 4; ++run) {
    BodyWorld::Settings settings;
    settings.tool_friction = 0.3;
    settings.sleeps = false;
    BodyWorld world(scene,
                    {body_at({0.0, 0.0, 0.0251}, cube()), body_at({0.0505, 0.001, 0.0251}, cube()),
                     body_at({0.101, 0.002, 0.0251}, cube())},
                    settings);
    const Vector3d centre_m = random.vector<3>(0.05), swing_m = random.vector<3>(0.03);
    const Vector3d turn = random.vector<3>(0.4);
    BodyWorld::Hand hand;
    hand.stiffness_per_s2 = 20000.0;
    hand.X_WP.translation_m = {centre_m.x(), 0.4 * centre_m.y(), 0.08};
    world.enter_tool(0, hand.X_WP);
    for (int k = 0; k < 3000; ++k) {
      const double t_s = kStep_s * k;
      hand.X_WP.translation_m = {centre_m.x() + swing_m.x() * std::sin(3.0 * t_s),
                                 0.4 * centre_m.y() + swing_m.y() * std::sin(2.3 * t_s),
                                 0.08 - std::min(0.06, 0.05 * t_s)};
      hand.X_WP.rotation = rotation_from(std::sin(t_s) * turn);
      unfinished += world.step(hand, kStep_s) != BodyWorld::Status::converged ? 1 : 0;
      double load_N = 0.0, friction_N = 0.0;
      for (const BodyContact& c : world.contacts()) {
        if (c.a != 0) continue;
        const double normal_N = c.force_W_N.dot(c.normal_W);
        load_N += normal_N;
        friction_N += (c.force_W_N - normal_N * c.normal_W).norm();
      }
      loaded += load_N > 1.0 ? 1 : 0;
      frictionless += load_N > 1.0 && friction_N < 1e-9 ? 1 : 0;
    }
  }
  INFO(frictionless << " of " << loaded << " steps without friction");
  CHECK(loaded > 5000);
  CHECK(50 * frictionless < loaded);
  CHECK(unfinished < 240);  // of 12,000
}

// An edge of the tool slides along an edge of a body that a fine mesh divides into 41 parts. Each part
// continues the one before, so its contact is known when the tool gets there, and nothing is solved again.
TEST_CASE("a tool slides along a divided edge as along a whole one", "[body_world]") {
  const auto slide = [](std::uint32_t triangles) {
    const Scene scene = table();
    BodyWorld::Settings settings;
    settings.sleeps = false;
    const ToolBody block = tool_body(make_mesh({"box", triangles, 1, Vector3d::Constant(0.05)}), 1.0, 10.0);
    BodyWorld world(scene, {body_at({0.0, 0.0, 0.025 + 1e-9}, block)}, settings);
    BodyWorld::Hand hand;
    hand.stiffness_per_s2 = 20000.0;
    // The lower edge of the tool lies across the body's edge at x = 25 mm.
    hand.X_WP.rotation = rotation_from({0.0, 0.25 * std::numbers::pi, 0.0}) * rotation_from({0.3, 0.0, 0.0});
    hand.X_WP.translation_m = {0.02, -0.01, 0.1};
    world.enter_tool(0, hand.X_WP);
    std::vector<Pose> path;
    int again = 0, touching = 0;
    for (int k = 0; k < 600; ++k) {
      hand.X_WP.translation_m.z() = std::max(0.1 - 2e-4 * k, 0.07);
      if (k > 200) hand.X_WP.translation_m.y() += 5e-5;
      CHECK(world.step(hand, kStep_s) == BodyWorld::Status::converged);
      path.push_back(world.motion(0).X_WB);
      if (k <= 200) continue;
      again += world.rounds() > 1 ? 1 : 0;
      touching += std::any_of(world.contacts().begin(), world.contacts().end(), [](const BodyContact& c) {
        return c.a == 0 && c.contact.kind == ContactKind::edge_edge;
      });
    }
    return std::make_tuple(path, again, touching);
  };
  const auto [whole, whole_again, whole_touching] = slide(12);
  const auto [divided, divided_again, divided_touching] = slide(20'000);
  CHECK(whole_touching > 300);
  CHECK(divided_touching == whole_touching);
  CHECK(whole_again < 5);
  CHECK(divided_again < 5);
  double apart_m = 0.0;
  for (std::size_t k = 0; k < whole.size(); ++k)
    apart_m = std::max(apart_m, (whole[k].translation_m - divided[k].translation_m).norm());
  CHECK(apart_m < 1e-8);
}

TEST_CASE("a tool among bodies that it does not touch follows its hand as a proxy does", "[body_world]") {
  std::vector<MeshObstacle> obstacles;
  obstacles.emplace_back("plate", MeshBvh(make_mesh({"box", 12, 1, {0.4, 0.4, 0.02}})),
                         Pose{Quaterniond::Identity(), {0.0, 0.0, -0.01}});
  const Scene scene(cube(), {}, {}, std::move(obstacles));
  BodyWorld world(scene, {body_at({0.15, 0.0, 0.025 + 1e-8}, cube())}, {});
  Proxy proxy(scene);
  BodyMotion tool;
  tool.X_WB.translation_m = {0.0, 0.0, 0.04};
  world.place(0, tool);
  Pose X_WQ = tool.X_WB;
  double deepest_m = 0.0;
  for (int k = 0; k < 1000; ++k) {
    const double t_s = k * kStep_s;
    Pose X_WP;
    X_WP.translation_m = {0.02 * std::sin(3.0 * t_s), 0.01 * t_s, 0.032 - 0.012 * std::sin(6.0 * t_s)};
    X_WP.rotation = rotation_from({0.2 * std::sin(5.0 * t_s), 0.15 * std::sin(4.0 * t_s), 0.3 * t_s});
    REQUIRE(world.step(BodyWorld::Hand{X_WP, 2000.0}, kStep_s) == BodyWorld::Status::converged);
    const Projection q = proxy.follow(X_WP, X_WQ);
    REQUIRE(q.status != ProjectionStatus::infeasible);
    X_WQ = q.X_WQ;
    INFO("tick " << k);
    CHECK((world.motion(0).X_WB.translation_m - X_WQ.translation_m).norm() < 1e-8);
    CHECK(world.motion(0).X_WB.rotation.angularDistance(X_WQ.rotation) < 1e-6);
    deepest_m = std::max(deepest_m, (X_WP.translation_m - X_WQ.translation_m).norm());
  }
  CHECK(deepest_m > 0.003);
}

TEST_CASE("an obstacle that moves lifts a body and carries it along", "[body_world]") {
  const auto on_plate = [](const Vector3d& velocity_m_per_s) {
    std::vector<MeshObstacle> obstacles;
    obstacles.emplace_back("plate", MeshBvh(make_mesh({"box", 12, 1, {0.4, 0.4, 0.02}})),
                           Pose{Quaterniond::Identity(), {0.0, 0.0, -0.01}},
                           ObstacleMotion{.linear_m_per_s = velocity_m_per_s});
    const Scene scene(cube(), {}, {}, std::move(obstacles));
    BodyWorld world(scene, {body_at({0.0, 0.0, 0.025 + 1e-8}, cube(), 0.5)}, {});
    CHECK(run(world, 0.5) == 0);
    return world.motion(1);
  };
  const BodyMotion lifted = on_plate({0.0, 0.0, 0.1});
  CHECK(lifted.X_WB.translation_m.z() == Approx(0.075).epsilon(1e-6));
  CHECK(lifted.velocity_W_m_per_s.z() == Approx(0.1).epsilon(1e-6));
  // It slides until it is as fast as the plate, after v / (mu g), and loses v / 2 meanwhile.
  const BodyMotion carried = on_plate({0.1, 0.0, 0.0});
  CHECK(carried.velocity_W_m_per_s.x() == Approx(0.1).epsilon(1e-6));
  const double lag_m = 0.5 * 0.1 * 0.1 / (0.5 * kGravity_m_per_s2);
  CHECK(carried.X_WB.translation_m.x() == Approx(0.05 - lag_m).epsilon(0.01));
  CHECK(carried.X_WB.translation_m.z() == Approx(0.025).epsilon(1e-6));
}

// The contacts of its lower face expire one after the other beyond the edge of the obstacle.
TEST_CASE("a body that slides off an obstacle falls", "[body_world]") {
  for (const std::uint32_t triangles : {12u, 5000u}) {
    CAPTURE(triangles);
    const auto mesh = [&](const Vector3d& size_m) { return make_mesh({"box", triangles, 1, size_m}); };
    std::vector<MeshObstacle> obstacles;
    obstacles.emplace_back("plate", MeshBvh(mesh({0.2, 0.2, 0.02})),
                           Pose{Quaterniond::Identity(), {0.0, 0.0, -0.01}});
    const Scene scene(cube(), {}, {}, std::move(obstacles));
    FreeBody body =
        body_at({0.05, 0.0, 0.025 + 1e-8}, tool_body(mesh(Vector3d::Constant(0.05)), 1.0, 0.1), 0.0);
    body.motion.velocity_W_m_per_s.x() = 1.0;
    BodyWorld world(scene, {body}, {});
    const double energy_J = world.energy_J();
    CHECK(run(world, 0.4) == 0);
    // Its centre passes the edge after 0.05 s and its last corner after 0.075 s.
    const Pose& X_WB = world.motion(1).X_WB;
    CHECK(X_WB.translation_m.x() == Approx(0.45).epsilon(0.05));
    CHECK(X_WB.translation_m.z() < 0.025 - 0.5 * kGravity_m_per_s2 * 0.325 * 0.325);
    CHECK(world.contacts().empty());
    CHECK(world.energy_J() <= energy_J + 1e-9);
  }
}

// Its contacts are forgotten while the hand is 29 mm below the tool. Swept as a whole, the path to the hand
// takes 35,327 node visits and does not end in this step.
TEST_CASE("a long path that meets something soon takes few node visits", "[body_world]") {
  const auto bumpy = [](std::uint32_t seed, double mass_kg) {
    return tool_body(make_mesh({"bumpy", 20'000, seed, Vector3d::Constant(0.05)}), 1.0, mass_kg);
  };
  const Scene scene(bumpy(1, 0.1), {HalfSpaceSettings{"table", Vector3d::UnitZ(), 0.0}});
  BodyWorld::Settings settings;
  settings.sleeps = false;
  BodyWorld world(scene, {body_at({0.0, 0.0, 0.05}, bumpy(2, 10.0))}, settings);
  BodyWorld::Hand hand;
  hand.stiffness_per_s2 = 20000.0;
  hand.X_WP.translation_m = {0.0, 0.0, 0.15};
  world.enter_tool(0, hand.X_WP);
  for (int k = 0; k < 400; ++k) {
    hand.X_WP.translation_m.z() = std::max(0.15 - 5e-4 * k, 0.08);
    world.step(hand, kStep_s);
  }
  REQUIRE_FALSE(world.contacts().empty());
  world.place(0, world.motion(0));
  CHECK(world.step(hand, kStep_s) == BodyWorld::Status::converged);
  CHECK(world.node_visits() < 10'000);
}

// The square of its length overflows a double.
TEST_CASE("a step ends also if the hand is too far away for a path", "[body_world]") {
  const Scene scene = table();
  for (const double far_m : {1e6, 1e160, 1e300})
    for (const Vector3d& direction : {Vector3d(1.0, 0.0, 0.0), Vector3d(0.0, 0.0, 1.0)}) {
      CAPTURE(far_m, direction.z());
      BodyWorld world(scene, {body_at({0.0, 0.0, 0.025 + 1e-9}, cube())}, {});
      BodyWorld::Hand hand;
      hand.X_WP.translation_m = {0.0, 0.0, 0.1};
      world.enter_tool(0, hand.X_WP);
      world.step(hand, kStep_s);
      hand.X_WP.translation_m += far_m * direction;
      world.step(hand, kStep_s);
      CHECK(world.motion(0).X_WB.translation_m.z() > 0.05);
      CHECK(world.motion(1).X_WB.translation_m.norm() == Approx(0.025));
    }
}

TEST_CASE("a step neither allocates nor locks", "[body_world]") {
  const Scene scene = table();
  std::vector<FreeBody> bodies;
  for (int k = 0; k < 3; ++k) bodies.push_back(body_at({0.004 * k, 0.0, 0.0255 + 0.051 * k}, cube()));
  BodyWorld world(scene, bodies, {});
  const test::RealtimeGuard guard;
  for (int k = 0; k < 200; ++k) world.step(std::nullopt, kStep_s);
  CHECK(guard.allocations() == 0);
  CHECK(guard.locks() == 0);
}

TEST_CASE("with its work used up a world stays as it was and is admissible", "[body_world]") {
  std::vector<MeshObstacle> obstacles;
  obstacles.emplace_back("plate", MeshBvh(make_mesh({"box", 12, 1, {0.4, 0.4, 0.02}})),
                         Pose{Quaterniond::Identity(), {0.0, 0.0, -0.01}});
  const Scene scene(cube(), {}, {}, std::move(obstacles));
  BodyWorld::Settings settings;
  settings.rounds = 1;
  BodyWorld world(scene, {body_at({0.0, 0.0, 0.0251}, cube())}, settings);
  bool spent = false;
  for (int k = 0; k < 20; ++k) {
    const Pose before = world.motion(1).X_WB;
    if (world.step(std::nullopt, kStep_s) == BodyWorld::Status::converged) continue;
    spent = true;
    CHECK(numbers_of(world.motion(1).X_WB) == numbers_of(before));
    CHECK(world.motion(1).velocity_W_m_per_s.norm() == 0.0);
  }
  CHECK(spent);
  CHECK(world.motion(1).X_WB.translation_m.z() >= 0.025);
}

}  // namespace
}  // namespace wrenchd::test_body_world
