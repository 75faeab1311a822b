// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <limits>
#include <numbers>

#include <catch2/catch.hpp>

#include "collision/meshes/convex_hull.hpp"
#include "collision/penetration.hpp"
#include "core/energy_law.hpp"
#include "core/friction.hpp"
#include "core/metric.hpp"
#include "core/wrench_law.hpp"
#include "tests/support/case_count.hpp"
#include "tests/support/exact_intersection.hpp"
#include "tests/support/manipulation_case.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/overlapping_scene.hpp"

namespace wrenchd::test_friction {

namespace {

using namespace test;

constexpr double kHalf_m = 0.025;  ///< half a side of the cube
constexpr double kDepth_m = 1e-3;  ///< depth by which the hand presses the cube

enum class Ground { half_space, convex, mesh };

/// The cube over an obstacle with its top at z = 0; the mesh is a table.
double top_m(Ground ground) {
  return ground == Ground::mesh ? 0.01 : 0.0;
}

Scene cube_on(Ground ground, std::size_t triangles = 12) {
  const TriangleMesh cube = make_mesh({"cube", triangles});
  if (ground == Ground::half_space)
    return Scene(tool_body(make_mesh({"cube", 12}), 1.0, 0.1), {half_space(Vector3d::UnitZ(), 0.0)});
  if (ground == Ground::convex) {
    std::vector<Vector3d> corners = subdivided_box_points(1, {0.4, 0.4, 0.1});
    for (Vector3d& p : corners) p.z() -= 0.05;
    return Scene(tool_body(make_mesh({"cube", 12}), 1.0, 0.1), {},
                 {convex_obstacle("box", convex_hull(corners))});
  }
  std::vector<MeshObstacle> obstacles;
  obstacles.push_back({"table", MeshBvh(make_mesh({"table", triangles})), Pose{}});
  return Scene(mesh_tool(cube), {}, {}, std::move(obstacles));
}

/// A proxy with friction that starts without contact.
struct Rubbed {
  Rubbed(Scene scene_, const FrictionSettings& friction, const Pose& X_start)
      : scene(std::move(scene_)),
        depth(scene, {Method::exact, 47, Proxy::kClearance_m, friction}),
        X_WQ(X_start) {}

  Penetration follow(const Pose& X_WP) {
    const Penetration p = depth.follow(X_WP, X_WQ);
    X_WQ = p.projection.X_WQ;
    return p;
  }
  Wrench wrench(const Pose& X_WP) const {  // in the axes of the world
    return expressed(X_WP.rotation, energy_wrench(scene.tool().solid.inertia, 1e4, X_WP, X_WQ));
  }

  Scene scene;
  PenetrationDepth depth;
  Pose X_WQ;
};

Pose upright(double x_m, double y_m, double z_m) {
  return {Quaterniond::Identity(), {x_m, y_m, z_m}};
}

/// The cube on the obstacle, with the hand kDepth_m below it.
struct SetDown : Rubbed {
  SetDown(Ground ground, const FrictionSettings& friction, std::size_t triangles = 12)
      : Rubbed(cube_on(ground, triangles), friction, upright(0.01, 0.02, top_m(ground) + kHalf_m + 2e-4)),
        z_m(top_m(ground) + kHalf_m - kDepth_m) {
    for (const double down : {0.0, 0.5, 1.0})
      follow(upright(0.01, 0.02, z_m + (1.0 - down) * (kDepth_m + 1e-4)));
  }
  /// Returns the hand pose at a displacement from the first contact.
  Pose at(double x_m, double y_m = 0.0) const { return upright(0.01 + x_m, 0.02 + y_m, z_m); }

  double z_m;
};

TEST_CASE("sliding friction is mu times the normal force, on every kind of obstacle", "[friction]") {
  const Ground ground = GENERATE(Ground::half_space, Ground::convex, Ground::mesh);
  for (const double mu : {0.1, 0.6, 1.5}) {
    SetDown s(ground, {mu, mu});
    const Vector3d way = Vector3d(0.8, 0.6, 0.0);
    for (int tick = 1; tick <= 60; ++tick) {
      const Vector3d moved = 5e-5 * tick * way;
      const Pose X_WP = s.at(moved.x(), moved.y());
      const Penetration p = s.follow(X_WP);
      INFO("ground " << static_cast<int>(ground) << ", mu " << mu << ", tick " << tick);
      REQUIRE(p.projection.status == ProjectionStatus::converged);
      REQUIRE(p.contacts >= 3);
      const Wrench F = s.wrench(X_WP);
      const Vector3d along = F.force_N - F.force_N.z() * Vector3d::UnitZ();
      // Tolerance 1e-6: 1 nm of clearance at a depth of 1 mm.
      const double most = mu * F.force_N.z();
      const double held = 1e4 * 0.1 * 5e-5 * tick;  // expected while the tool sticks
      REQUIRE(along.dot(-way) == Approx(std::min(most, held)).epsilon(2e-6));
      REQUIRE(along.cross(way).norm() < 1e-9 * most);
      REQUIRE(F.force_N.z() == Approx(1e4 * 0.1 * kDepth_m).epsilon(2e-6));
      REQUIRE(F.torque_Nm.norm() < 1e-9);
      REQUIRE(p.projection.energy ==
              Approx(energy(s.scene.tool().solid.inertia, X_WP, s.X_WQ)).epsilon(1e-12));
    }
  }
}

TEST_CASE("a sticking tool keeps its pose bit for bit", "[friction]") {
  const Ground ground = GENERATE(Ground::half_space, Ground::convex, Ground::mesh);
  INFO("ground " << static_cast<int>(ground));
  SetDown s(ground, {0.8, 0.8});
  const Pose X_stuck = s.X_WQ;
  RandomValues random(3);
  for (int tick = 0; tick < 200; ++tick) {
    Pose X_WP = s.at(random.uniform(-2e-4, 2e-4), random.uniform(-2e-4, 2e-4));
    X_WP.translation_m.z() += random.uniform(-5e-4, 5e-4);
    X_WP.rotation = rotation_from({0.0, 0.0, random.uniform(-2e-3, 2e-3)});
    const Penetration p = s.follow(X_WP);
    INFO("tick " << tick);
    REQUIRE(same_bits(s.X_WQ, X_stuck));
    REQUIRE(p.projection.status == ProjectionStatus::converged);
    REQUIRE(p.contacts >= 3);
  }
  // When the hand lifts the tool, friction ends at once.
  Pose X_WP = s.at(2e-4);
  X_WP.translation_m.z() += kDepth_m + 1e-5;
  CHECK(s.follow(X_WP).contacts == 0);
  CHECK((s.X_WQ.translation_m - X_WP.translation_m).norm() < 1e-12);
}

TEST_CASE("a tool at rest starts to slide at the static and continues at the dynamic coefficient",
          "[friction]") {
  const Ground ground = GENERATE(Ground::half_space, Ground::convex, Ground::mesh);
  INFO("ground " << static_cast<int>(ground));
  SetDown s(ground, {0.8, 0.5});
  for (int tick = 0; tick < 30; ++tick) s.follow(s.at(0.0));
  const auto lag = [&](const Pose& X_WP) {
    return (X_WP.translation_m.x() - s.X_WQ.translation_m.x()) /
           (s.X_WQ.translation_m.z() - X_WP.translation_m.z());
  };
  double largest = 0.0;
  double x_m = 0.0;
  const Pose X_stuck = s.X_WQ;
  for (; same_bits(s.X_WQ, X_stuck); x_m += 1e-5) {
    s.follow(s.at(x_m));
    largest = std::max(largest, lag(s.at(x_m)));
  }
  CHECK(largest > 0.78);
  CHECK(largest < 0.801);
  // With an encoder step of 10 um the hand is at rest in nine of ten ticks, which must not cause sticking.
  for (int tick = 0; tick < 200; ++tick) {
    const Pose X_WP = s.at(x_m + 1e-5 * (tick / 10));
    s.follow(X_WP);
    REQUIRE(lag(X_WP) == Approx(0.5).epsilon(1e-5));
  }
  // At rest static friction applies again.
  x_m += 2e-4;
  for (int tick = 0; tick < 30; ++tick) s.follow(s.at(x_m));
  s.follow(s.at(x_m + 0.25 * kDepth_m));
  CHECK(lag(s.at(x_m + 0.25 * kDepth_m)) == Approx(0.75).epsilon(1e-5));
}

TEST_CASE("a tool that slides does not chatter", "[friction]") {
  const Ground ground = GENERATE(Ground::half_space, Ground::convex, Ground::mesh);
  INFO("ground " << static_cast<int>(ground));
  SetDown s(ground, {0.7, 0.5});
  Vector6d last[2];
  double jolt = 0.0, largest = 0.0;
  for (int tick = 0; tick < 2000; ++tick) {  // a circle of 20 mm per second with varying depth
    const double t = 1e-3 * tick;
    Pose X_WP = s.at(0.02 * std::sin(2.0 * std::numbers::pi * t),
                     0.02 * (1.0 - std::cos(2.0 * std::numbers::pi * t)));
    X_WP.translation_m.z() += 3e-4 * std::sin(5.0 * t);
    s.follow(X_WP);
    const Wrench F = s.wrench(X_WP);
    Vector6d now;
    now << F.force_N, F.torque_Nm;
    largest = std::max(largest, now.norm());
    if (tick > 100) jolt = std::max(jolt, (now - 2.0 * last[0] + last[1]).norm());
    last[1] = last[0];
    last[0] = now;
  }
  CHECK(largest > 1.0);
  CHECK(jolt < 2e-4 * largest);  // the circle itself contributes (2 pi / 1000)^2 = 4e-5
}

TEST_CASE("when the hand stops, the tool comes to rest", "[friction]") {
  const Ground ground = GENERATE(Ground::half_space, Ground::convex, Ground::mesh);
  RandomValues random(4);
  for (int n = 0; n < 10; ++n) {
    SetDown s(ground, {0.5, 0.3});
    Pose X_WP;
    for (int tick = 0; tick < 50; ++tick) {
      X_WP = s.at(1e-4 * tick * random.uniform(0.5, 1.0), 2e-5 * tick);
      X_WP.rotation = rotation_from(1e-4 * tick * Vector3d(0.3, 0.5, 1.0));
      s.follow(X_WP);
    }
    double T = std::numeric_limits<double>::infinity();
    for (int tick = 0; tick < 100; ++tick) {
      const Pose X_before = s.X_WQ;
      const double now = s.follow(X_WP).projection.energy;
      INFO("ground " << static_cast<int>(ground) << ", run " << n << ", tick " << tick);
      REQUIRE(now <= T * (1.0 + 1e-12));
      if (tick > 10) REQUIRE(same_bits(s.X_WQ, X_before));
      T = now;
    }
  }
}

TEST_CASE("a cube on its face rotates only if the torque exceeds the friction of all its corners",
          "[friction]") {
  const Ground ground = GENERATE(Ground::half_space, Ground::convex, Ground::mesh);
  INFO("ground " << static_cast<int>(ground));
  const double mu = 0.4;
  SetDown s(ground, {mu, mu});
  const Pose X_stuck = s.X_WQ;
  bool slides = false;
  for (int tick = 0; tick < 400; ++tick) {
    Pose X_WP = s.at(0.0);
    X_WP.rotation = rotation_from({0.0, 0.0, 2e-4 * tick});
    s.follow(X_WP);
    const Wrench F = s.wrench(X_WP);
    // The corners carry the load, all at the same distance from the middle.
    const double most = mu * F.force_N.z() * kHalf_m * std::sqrt(2.0);
    const double held = 1e4 * s.scene.tool().solid.inertia.H_kg_m2(2, 2) * 2e-4 * tick;
    INFO("tick " << tick);
    slides = slides || held > most;
    if (!slides) REQUIRE(same_bits(s.X_WQ, X_stuck));
    // Tolerance: the square of the angle, the difference of a rotation and a line.
    REQUIRE(-F.torque_Nm.z() == Approx(std::min(held, most)).epsilon(5e-3).margin(1e-12));
    REQUIRE((s.X_WQ.translation_m - X_stuck.translation_m).norm() < 1e-9);
  }
  CHECK(slides);
}

/// A tool on its tip: an inverted pyramid of 50 mm.
Rubbed on_tip(const FrictionSettings& friction) {
  std::vector<Vector3d> points = {{0, 0, 0}};
  for (const double x : {-0.02, 0.02})
    for (const double y : {-0.02, 0.02}) points.emplace_back(x, y, 0.05);
  return Rubbed(Scene(tool_of(points, 0.1), {half_space(Vector3d::UnitZ(), 0.0)}), friction,
                upright(0, 0, 0.04));
}

TEST_CASE("friction at a tip resists sliding, but neither spinning nor tilting", "[friction]") {
  Rubbed s = on_tip({0.9, 0.9});
  const double height_m = s.scene.tool().solid.p_MT_m.z();  // height of the centre of mass above the tip
  const auto tip = [&](const Pose& X) { return X * Vector3d(0, 0, -height_m); };
  for (const double z : {1e-4, -1e-3, -1e-3}) s.follow(upright(0, 0, height_m + z));
  const Vector3d tip_stuck = tip(s.X_WQ);
  Pose X_WP;
  for (int tick = 0; tick < 1000; ++tick) {  // spinning, tilting and sliding
    const double t = 1e-3 * tick;
    X_WP.rotation =
        rotation_from({0.2 * std::sin(3.0 * t), 0.1 * std::sin(5.0 * t), 0.0}) * rotation_from({0, 0, t});
    X_WP.translation_m = X_WP.rotation * Vector3d(0, 0, height_m) + Vector3d(2e-4 * std::sin(t), 1e-4, -1e-3);
    s.follow(X_WP);
    INFO("tick " << tick);
    REQUIRE((tip(s.X_WQ) - tip_stuck).norm() < 1e-8);
    REQUIRE(s.X_WQ.rotation.angularDistance(X_WP.rotation) < 0.02);
    // Friction at the tip has no lever about it, up to the curvature of the tip's path.
    const Vector3d tau =
        wrench_about(tip(s.X_WQ), X_WP, energy_wrench(s.scene.tool().solid.inertia, 1e4, X_WP, s.X_WQ))
            .torque_Nm;
    REQUIRE(tau.norm() < 0.04 * s.wrench(X_WP).force_N.norm() * height_m);
  }
}

TEST_CASE("friction uses the normal forces after it has shifted the load", "[friction]") {
  // A tip that leans forward or back: friction at the tip tilts the tool, which changes the normal force.
  for (const double mu : {0.2, 0.5})
    for (const double tilt : {-0.4, 0.0, 0.4}) {
      Rubbed s = on_tip({mu, mu});
      const Quaterniond R = rotation_from({0, tilt, 0});
      const Vector3d up = R * s.scene.tool().solid.p_MT_m;
      double ratio = 0.0;
      for (int tick = -2; tick < 400; ++tick) {
        const Vector3d way = {4e-6 * std::max(tick, 0), 0, tick == -2 ? 1e-4 : -0.2 * kDepth_m};
        const Pose X_WP = {R, up + way};
        s.follow(X_WP);
        const Vector3d f = s.wrench(X_WP).force_N;
        INFO("mu " << mu << ", tilt " << tilt << ", tick " << tick);
        REQUIRE(std::abs(f.y()) <= 1e-6 * f.z());
        if (tick > 0) REQUIRE(-f.x() < 1.06 * mu * f.z());
        ratio = -f.x() / f.z();
      }
      INFO("mu " << mu << ", tilt " << tilt);
      CHECK(ratio ==
            Approx(mu).epsilon(0.06));  // depth times height over the square of the radius of gyration: 0.04
    }
}

TEST_CASE("friction does not act on a tool before contact", "[friction]") {
  const Ground ground = GENERATE(Ground::half_space, Ground::convex, Ground::mesh);
  INFO("ground " << static_cast<int>(ground));
  const double z_m = top_m(ground) + kHalf_m;
  const FrictionSettings rough = {2.0, 2.0};
  Rubbed s(cube_on(ground), rough, upright(0, 0, z_m + 1e-3));
  Rubbed smooth(cube_on(ground), {}, s.X_WQ);
  const Pose X_landed = upright(4e-3, 0, z_m - kDepth_m);
  s.follow(X_landed);
  smooth.follow(X_landed);
  CHECK(same_bits(s.X_WQ, smooth.X_WQ));
  const Pose X_on = upright(5e-3, 0, z_m - kDepth_m);
  s.follow(X_on);
  CHECK(same_bits(s.X_WQ, smooth.X_WQ));  // the tool sticks there
  // The same holds for a tool that is moved without history.
  s.depth.clear_history();
  s.follow(X_on);
  CHECK(s.X_WQ.translation_m.x() == Approx(5e-3).epsilon(1e-12));
  s.X_WQ.translation_m.x() -= 1e-3;
  s.follow(X_on);
  CHECK(s.X_WQ.translation_m.x() == Approx(5e-3).epsilon(1e-12));
}

TEST_CASE("a tool that slides into a wall reaches the wall and has friction at it", "[friction]") {
  const Scene scene(tool_body(make_mesh({"cube", 12}), 1.0, 0.1),
                    {half_space(Vector3d::UnitZ(), 0.0), half_space(-Vector3d::UnitX(), -0.03)});
  Rubbed s(scene, {0.5, 0.5}, upright(0, 0, kHalf_m + 1e-4));
  for (const double z : {0.0, -0.5e-3, -kDepth_m}) s.follow(upright(0, 0, kHalf_m + z));
  for (int tick = 1; tick <= 20; ++tick) s.follow(upright(5e-4 * tick, 0, kHalf_m - kDepth_m));
  CHECK(s.X_WQ.translation_m.x() == Approx(5e-3).margin(2e-9));
  // Contact with both: the hand is 1 mm below the floor and 5 mm behind the wall.
  for (int tick = 1; tick <= 200; ++tick) s.follow(upright(0.01, 1e-4 * tick, kHalf_m - kDepth_m));
  CHECK(0.02 - s.X_WQ.translation_m.y() == Approx(0.5 * (kDepth_m + 5e-3)).epsilon(1e-5));
}

TEST_CASE("a tilted cube can be set down on its face while its edge sticks", "[friction]") {
  const Ground ground = GENERATE(Ground::half_space, Ground::convex, Ground::mesh);
  INFO("ground " << static_cast<int>(ground));
  const double z_m = top_m(ground) + kHalf_m - kDepth_m;
  Rubbed s(cube_on(ground), {0.8, 0.8}, upright(0, 0, top_m(ground) + kHalf_m + 0.01));
  for (int tick = 0; tick <= 300; ++tick) {
    const double tilt = 0.2 * std::max(0.0, 1.0 - tick / 200.0);
    s.follow({rotation_from({tilt, 0, 0}), {0, 0, z_m + kHalf_m * tilt}});
  }
  CHECK(s.X_WQ.rotation.angularDistance(Quaterniond::Identity()) < 1e-6);
  CHECK(s.X_WQ.translation_m.z() == Approx(top_m(ground) + kHalf_m).margin(1e-8));
}

TEST_CASE("the friction of a cube on a table does not depend on the triangulation", "[friction]") {
  const auto wrenches = [](std::size_t triangles) {
    Rubbed s(cube_on(Ground::mesh, triangles), {0.5, 0.3}, upright(0, 0, 0.0351));
    std::vector<Vector6d> out;
    for (int tick = 0; tick < 1500; ++tick) {
      const double t = 1e-3 * tick;
      const Pose X_WP = {rotation_from({0.02 * std::sin(7.0 * t), 0.015 * std::cos(5.0 * t), t}),
                         {0.05 * std::sin(2.0 * t), 0.03 * t, 0.0345 - 0.001 * std::min(1.0, 10.0 * t)}};
      s.follow(X_WP);
      const Wrench F = s.wrench(X_WP);
      Vector6d row;
      row << F.force_N, F.torque_Nm;
      out.push_back(row);
    }
    return out;
  };
  const std::vector<Vector6d> coarse = wrenches(12), fine = wrenches(1200);
  double largest = 0.0, along = 0.0, difference = 0.0;
  for (std::size_t i = 0; i < coarse.size(); ++i) {
    largest = std::max(largest, coarse[i].norm());
    along = std::max(along, coarse[i].head<2>().norm());
    difference = std::max(difference, (fine[i] - coarse[i]).norm());
  }
  CHECK(along > 0.2 * largest);
  CHECK(difference < 1e-6 * largest);
}

TEST_CASE("a proxy with friction never overlaps an obstacle, in exact arithmetic", "[friction][proxy]") {
  const auto i = GENERATE(range<std::size_t>(0, 20));
  const ManipulationCase& handling = manipulation_cases()[i];
  INFO(handling.name);
  Rubbed s(scene_of(handling), {0.7, 0.4}, {Quaterniond::Identity(), handling.start_m});
  const ExactIntersection exact(s.scene.tool_mesh()->surface.mesh(),
                                s.scene.meshes()[0].mesh->surface.mesh());
  HandTrajectory hand(handling, 2);
  int contacts = 0, stuck = 0, spent = 0;
  for (int tick = 0; tick < case_count(300); ++tick) {
    const Pose X_before = s.X_WQ;
    const Penetration p = s.follow(hand.next());
    INFO("tick " << tick);
    REQUIRE(p.projection.status != ProjectionStatus::infeasible);
    REQUIRE_FALSE(exact.intersect(s.X_WQ));
    contacts += p.contacts > 0 ? 1 : 0;
    stuck += same_bits(s.X_WQ, X_before) ? 1 : 0;
    spent += p.projection.status == ProjectionStatus::budget_spent ? 1 : 0;
  }
  if (case_count(300) == 300) CHECK(contacts > 10);
  CAPTURE(stuck, spent);
}

TEST_CASE("a convex tool with friction never overlaps convex bodies", "[friction][convex]") {
  RandomValues random(8);  // case 18 once overlapped the half-space by 1.3 mm
  int contacts = 0;
  const int runs = case_count(20);
  for (int n = 0; n < runs; ++n) {
    const Scene scene(random_body(random, 20), {half_space(Vector3d::UnitZ(), -1.0)},
                      {convex_obstacle("body", random_body(random, 20).hull)});
    Rubbed s(scene, {0.6, 0.4}, {random.rotation(), {0.0, 0.0, 3.0}});
    Vector3d w = Vector3d::Zero();
    for (int tick = 0; tick < 300; ++tick) {
      const double t = 1e-2 * tick;
      w += 0.03 * random.unit<3>();
      const Pose X_WP = {rotation_from(w), {0.6 * std::sin(t), 0.5 * std::cos(0.7 * t), 2.0 - t}};
      const Penetration p = s.follow(X_WP);
      contacts += p.contacts > 0 ? 1 : 0;
      INFO("run " << n << ", tick " << tick);
      REQUIRE(p.projection.status != ProjectionStatus::infeasible);
      REQUIRE(separation_m(s.scene, s.X_WQ) > -1e-12);
      REQUIRE(least_gap_m(s.scene, s.X_WQ) > -1e-12);
    }
  }
  CHECK(contacts > 45 * runs);
}

TEST_CASE("friction neither allocates nor locks", "[realtime][friction]") {
  for (const std::size_t i : {7, 15, 16}) {
    const ManipulationCase& handling = manipulation_cases()[i];
    INFO(handling.name);
    Rubbed s(scene_of(handling), {0.5, 0.3}, {Quaterniond::Identity(), handling.start_m});
    HandTrajectory hand(handling);
    const RealtimeGuard guard;
    for (int tick = 0; tick < 300; ++tick) s.follow(hand.next());
    CHECK(guard.allocations() == 0);
    CHECK(guard.locks() == 0);
  }
  for (const Ground ground : {Ground::half_space, Ground::convex}) {
    SetDown s(ground, {0.5, 0.3});
    int slid = 0;
    std::uint64_t allocations = 0, locks = 0;
    {
      const RealtimeGuard guard;
      for (int tick = 0; tick < 300; ++tick) {
        const Pose X_before = s.X_WQ;
        s.follow(
            {rotation_from({0.01 * std::sin(0.1 * tick), 0, 1e-3 * tick}), s.at(1e-5 * tick).translation_m});
        slid += same_bits(X_before, s.X_WQ) ? 0 : 1;
      }
      allocations = guard.allocations();
      locks = guard.locks();
    }
    CHECK(slid > 30);
    CHECK(allocations == 0);
    CHECK(locks == 0);
  }
}

TEST_CASE("a contact that closes in this tick has no friction", "[friction]") {
  const Scene scene = cube_on(Ground::half_space);
  PenetrationDepth depth(scene, {});
  const Pose X_last = upright(0, 0, kHalf_m), X_WP = upright(1e-4, 0, kHalf_m - kDepth_m);
  Projection touching = depth.follow(X_WP, X_last).projection;
  touching.X_WQ = X_last;
  Friction friction(scene.tool().solid.inertia, {0.5, 0.5}, 0.0);
  CHECK(same_bits(friction.frictional_goal(X_WP, X_last), X_WP));  // without history
  friction.store_contacts(touching);
  friction.frictional_goal(X_WP, X_last);
  CHECK(friction.sticks());
  Projection above = touching;
  above.X_WQ.translation_m.z() += 1e-6;
  friction.store_contacts(above);
  CHECK(same_bits(friction.frictional_goal(X_WP, above.X_WQ), X_WP));
  CHECK_FALSE(friction.sticks());
}

TEST_CASE("only method exact supports friction; the other methods reject it", "[friction]") {
  const Scene scene = cube_on(Ground::half_space);
  for (const Method method : {Method::planar, Method::descent, Method::translational})
    CHECK_THROWS_WITH(PenetrationDepth(scene, {method, 47, 0.0, {0.5, 0.3}}),
                      Catch::Contains("only method exact supports friction; choose it") &&
                          Catch::Contains("[rendering.friction]"));
}

}  // namespace
}  // namespace wrenchd::test_friction
