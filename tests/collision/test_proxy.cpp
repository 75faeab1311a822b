// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <vector>

#include <catch2/catch.hpp>

#include "collision/feasible_pose_search.hpp"
#include "collision/meshes/convex_hull.hpp"
#include "collision/penetration.hpp"
#include "collision/proxy.hpp"
#include "core/energy_law.hpp"
#include "core/metric.hpp"
#include "tests/support/case_count.hpp"
#include "tests/support/exact_intersection.hpp"
#include "tests/support/manipulation_case.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/unbalanced_pull.hpp"

namespace wrenchd::test_proxy {

namespace {

using namespace test;

bool in_contact(const Projection& q) {
  return q.status == ProjectionStatus::converged || q.status == ProjectionStatus::budget_spent;
}

/// The commanded pose, followed from the start.
struct Followed {
  explicit Followed(const ManipulationCase& handling)
      : scene(scene_of(handling)), proxy(scene), X_WQ{Quaterniond::Identity(), handling.start_m} {}

  Projection follow(const Pose& X_WP) {
    const Projection q = proxy.follow(X_WP, X_WQ);
    X_WQ = q.X_WQ;
    return q;
  }

  Scene scene;
  Proxy proxy;
  Pose X_WQ;
};

Scene two(TriangleMesh tool, TriangleMesh obstacle) {
  std::vector<MeshObstacle> obstacles;
  obstacles.push_back({"obstacle", MeshBvh(std::move(obstacle)), Pose{}});
  return Scene(mesh_tool(std::move(tool)), {}, {}, std::move(obstacles));
}

TEST_CASE("a proxy overlaps nothing for any motion of the hand, by exact arithmetic", "[proxy]") {
  const auto i = GENERATE(range<std::size_t>(0, 20));
  const ManipulationCase& handling = manipulation_cases()[i];
  INFO(handling.name);
  Followed f(handling);
  const ExactIntersection exact(f.scene.tool_mesh()->surface.mesh(),
                                f.scene.meshes()[0].mesh->surface.mesh());
  HandTrajectory hand(handling);
  REQUIRE_FALSE(exact.intersect(f.X_WQ));
  int contacts = 0;
  for (int tick = 0; tick < case_count(600); ++tick) {
    const Projection q = f.follow(hand.next());
    REQUIRE(q.status != ProjectionStatus::infeasible);
    INFO("tick " << tick << ", sweeps " << f.proxy.sweeps());
    REQUIRE_FALSE(exact.intersect(q.X_WQ));
    contacts += in_contact(q) ? 1 : 0;
  }
  if (case_count(600) == 600) CHECK(contacts > 10);  // up to a tenth of the ticks may not reach a contact
}

TEST_CASE("a plate of 1 mm stops a stab at 5 m/s", "[proxy]") {
  for (const std::size_t i : {0, 1, 2, 3, 5}) {
    const ManipulationCase& handling = manipulation_cases()[i];
    INFO(handling.name);
    Followed f(handling);
    HandTrajectory hand(handling);
    double deepest_m = 0.0;
    for (int tick = 0; tick < 400; ++tick) {
      const Pose X_WP = hand.next();
      f.follow(X_WP);
      deepest_m = std::max(deepest_m, -X_WP.translation_m.z());
      REQUIRE(f.X_WQ.translation_m.z() >
              0.0);  // the plate's middle is at zero, and the plate is wider than the stabs
    }
    CHECK(deepest_m > 0.03);
  }
}

TEST_CASE("at rest a proxy is a local optimum, and most often the nearest of all", "[proxy]") {
  RandomValues random(5);
  int nearest = 0;
  const TriangleMesh cube = make_mesh({"cube", 12}), ball = make_mesh({"sphere", 320});
  for (int n = 0; n < 40; ++n) {
    const bool round = random.chance(0.5);
    const Scene scene = two(round ? ball : cube, cube);
    // The same bodies as convex bodies, whose global optimum is known.
    ToolBody tool = tool_body(round ? ball : cube, 1.0, 0.1);
    const Scene convex(std::move(tool), {}, {convex_obstacle("cube", convex_hull(cube.vertices_m))});
    PenetrationDepth depth(convex, {});
    const Vector3d out = random.unit<3>();
    Pose X_WP = {random.rotation(), 0.2 * out};
    Proxy proxy(scene);
    Projection q = proxy.follow(X_WP, X_WP);
    REQUIRE(q.status == ProjectionStatus::free);
    // Moves in along a straight line by about a millimetre, then rests.
    double from_m = 0.2, depth_m = 0.0;
    while (depth_m < 1e-3 && from_m > 0.0) {
      from_m -= 1e-4;
      X_WP.translation_m = from_m * out;
      q = proxy.follow(X_WP, q.X_WQ);
      depth_m = q.status == ProjectionStatus::free ? 0.0 : (q.X_WQ.translation_m - X_WP.translation_m).norm();
    }
    for (int tick = 0; tick < 20; ++tick) q = proxy.follow(X_WP, q.X_WQ);
    INFO(n << " round " << round);
    REQUIRE(q.status == ProjectionStatus::converged);
    CHECK(q.kkt_residual < 1e-6);
    const double best = depth.query(X_WP).projection.energy;
    CHECK(q.energy >= best);
    nearest += q.energy <= 1.001 * best ? 1 : 0;
    // No pose around it is admissible and nearer.
    const ExactIntersection exact(scene.tool_mesh()->surface.mesh(), cube);
    for (int k = 0; k < 200; ++k) {
      const double reach = random.log_uniform(1e-6, 1e-3);
      const Pose X_near = {
          (q.X_WQ.rotation * random.rotation(30.0 * reach * random.uniform(0.0, 1.0))).normalized(),
          q.X_WQ.translation_m + reach * random.uniform(0.0, 1.0) * random.unit<3>()};
      if (energy(scene.tool().solid.inertia, X_WP, X_near) < q.energy * (1.0 - 1e-4))
        CHECK(exact.intersect(X_near));
    }
  }
  CHECK(nearest >= 36);
}

// The residual is computed independently, and contacts count only where both bodies are.
TEST_CASE("a tick that says converged has a pull that its contacts balance", "[proxy]") {
  for (const BodyKind kind : {BodyKind::solid, BodyKind::surface})
    for (const std::size_t i : {5, 7, 11, 13, 15, 19}) {
      ManipulationCase handling = manipulation_cases()[i];
      handling.obstacle_kind = kind;
      INFO(handling.name << (kind == BodyKind::surface ? ", as a surface" : ""));
      Followed f(handling);
      HandTrajectory hand(handling, 5);
      int converged = 0, spent = 0, needless = 0;
      for (int tick = 0; tick < case_count(900); ++tick) {
        const Pose X_WP = hand.next();
        const Projection q = f.follow(X_WP);
        INFO("tick " << tick << ", reported residual " << q.kkt_residual);
        if (q.status == ProjectionStatus::converged) {
          ++converged;
          REQUIRE(q.kkt_residual <= kOptimalResidual);
          REQUIRE(unbalanced_pull(f.scene, X_WP, q) <= 1e-6);
        }
        if (q.status != ProjectionStatus::budget_spent) continue;
        ++spent;
        needless += q.kkt_residual <= kOptimalResidual ? 1 : 0;
      }
      CHECK(spent <= 10 + converged / 10);
      CHECK(needless <= 1);  // an optimum is not called unfinished
    }
}

/// A sheet of 0.2 m square in z = 0, in n x n cells; every second one faces down.
TriangleMesh sheet(std::uint32_t n) {
  TriangleMesh mesh;
  for (std::uint32_t i = 0; i <= n; ++i)
    for (std::uint32_t j = 0; j <= n; ++j)
      mesh.vertices_m.emplace_back(0.2 * i / n - 0.1, 0.2 * j / n - 0.1, 0.0);
  for (std::uint32_t i = 0; i < n; ++i)
    for (std::uint32_t j = 0; j < n; ++j) {
      const std::uint32_t a = i * (n + 1) + j, b = a + n + 1;
      mesh.triangles.push_back({a, b, b + 1});
      mesh.triangles.push_back({a, b + 1, a + 1});
      if ((i + j) % 2 == 1)
        for (std::size_t k = 1; k < 3; ++k) {
          auto& corners = mesh.triangles[mesh.triangles.size() - k];
          std::swap(corners[1], corners[2]);
        }
    }
  return mesh;
}

Scene against_surface(TriangleMesh tool, TriangleMesh surface) {
  std::vector<MeshObstacle> obstacles;
  obstacles.push_back({"surface", MeshBvh(std::move(surface), BodyKind::surface), Pose{}});
  return Scene(mesh_tool(std::move(tool)), {}, {}, std::move(obstacles));
}

TEST_CASE("an open surface stops a tool on the side where it is", "[proxy]") {
  for (const char* kind : {"cube", "sphere"})
    for (const std::uint32_t cells : {1, 2, 9})
      for (const double side : {1.0, -1.0}) {
        const Scene scene = against_surface(make_mesh({kind, 320}), sheet(cells));
        const ExactIntersection exact(scene.tool_mesh()->surface.mesh(),
                                      scene.meshes()[0].mesh->surface.mesh());
        PenetrationDepth depth(scene, {});
        RandomValues random(cells);
        Pose X_WQ = {Quaterniond::Identity(), {0, 0, 0.06 * side}};
        Penetration last;
        for (int tick = 0; tick < 150; ++tick) {  // a millimetre per tick, then rest
          const Pose X_WP = {rotation_from(tick < 120 ? Vector3d(0.02 * random.unit<3>()) : Vector3d::Zero()),
                             {0.01, 0.02, side * (0.06 - 1e-3 * std::min(tick, 120))}};
          last = depth.follow(X_WP, X_WQ);
          X_WQ = last.projection.X_WQ;
          INFO(kind << " " << cells << " cells, side " << side << ", tick " << tick);
          REQUIRE(last.projection.status != ProjectionStatus::infeasible);
          REQUIRE(side * X_WQ.translation_m.z() > 0.0249);
          REQUIRE_FALSE(exact.intersect(X_WQ));
        }
        CHECK(last.contacts > 0);
        CHECK(side * X_WQ.translation_m.z() < 0.0301);
        CHECK(side * last.eps[2] > 0.08);  // pulled back
      }
}

TEST_CASE("the border and the self-intersections of a surface hold the tool", "[proxy]") {
  TriangleMesh cross = sheet(2);  // a second, upright sheet through its middle
  const auto first = static_cast<std::uint32_t>(cross.vertices_m.size());
  for (const Vector3d& p : sheet(2).vertices_m) cross.vertices_m.emplace_back(p.x(), 0.003, p.y());
  for (auto corners : sheet(2).triangles) {
    for (std::uint32_t& v : corners) v += first;
    cross.triangles.push_back(corners);
  }
  const Scene scene = against_surface(make_mesh({"cube", 12}), std::move(cross));
  const ExactIntersection exact(scene.tool_mesh()->surface.mesh(), scene.meshes()[0].mesh->surface.mesh());
  RandomValues random(8);
  for (int run = 0; run < 6; ++run) {
    Proxy proxy(scene);
    Pose X_WQ = {random.rotation(0.3), {0.0, 0.08, 0.08}};
    Pose X_WP = X_WQ;
    int contacts = 0;
    REQUIRE_FALSE(exact.intersect(X_WQ));
    for (int tick = 0; tick < 200; ++tick) {
      X_WP.translation_m += 4e-3 * random.unit<3>() - 0.02 * (X_WP.translation_m - Vector3d(0.05, 0, 0));
      X_WP.rotation = (X_WP.rotation * random.rotation(0.03)).normalized();
      const Projection q = proxy.follow(X_WP, X_WQ);
      X_WQ = q.X_WQ;
      contacts += in_contact(q) ? 1 : 0;
      INFO("run " << run << ", tick " << tick);
      REQUIRE_FALSE(exact.intersect(X_WQ));
    }
    CHECK(contacts > 20);
  }
}

/// A cube slides and rocks on a table. Both have this number of triangles.
std::vector<Vector6d> wrenches(std::size_t triangles, int ticks) {
  const Scene scene = two(make_mesh({"cube", triangles}), make_mesh({"table", triangles}));
  Proxy proxy(scene);
  std::vector<Vector6d> out;
  Pose X_WQ = {Quaterniond::Identity(), {0, 0, 0.0351}};
  for (int tick = 0; tick < ticks; ++tick) {
    const double t = 1e-3 * tick;
    const Pose X_WP = {rotation_from({0.02 * std::sin(7.0 * t), 0.015 * std::cos(5.0 * t), t}),
                       {0.05 * std::sin(2.0 * t), 0.03 * t, 0.0345 - 0.001 * std::min(1.0, 10.0 * t)}};
    X_WQ = proxy.follow(X_WP, X_WQ).X_WQ;
    const Wrench F = energy_wrench(scene.tool().solid.inertia, 1e5, X_WP, X_WQ);
    Vector6d row;
    row << F.force_N, F.torque_Nm;
    out.push_back(row);
  }
  return out;
}

TEST_CASE("a cube on a table has the same contact at every triangulation, without chatter", "[proxy]") {
  const int ticks = 1500;
  const std::vector<Vector6d> coarse = wrenches(12, ticks);
  double largest = 0.0, jolt = 0.0;
  for (const Vector6d& F : coarse) largest = std::max(largest, F.norm());
  for (std::size_t i = 2; i < coarse.size(); ++i)
    jolt = std::max(jolt, (coarse[i] - 2.0 * coarse[i - 1] + coarse[i - 2]).norm());
  CHECK(largest > 5.0);
  for (const std::size_t triangles : {1200, 120000}) {
    const std::vector<Vector6d> fine = wrenches(triangles, ticks);
    double difference = 0.0, fine_jolt = 0.0;
    for (std::size_t i = 0; i < fine.size(); ++i)
      difference = std::max(difference, (fine[i] - coarse[i]).norm());
    for (std::size_t i = 2; i < fine.size(); ++i)
      fine_jolt = std::max(fine_jolt, (fine[i] - 2.0 * fine[i - 1] + fine[i - 2]).norm());
    INFO(triangles << " triangles");
    CHECK(difference < 1e-6 * largest);
    CHECK(fine_jolt < jolt + 1e-6 * largest);
  }
}

TEST_CASE("a proxy slides along a wall made of flush blocks without catching on the seams", "[proxy]") {
  std::vector<MeshObstacle> blocks;
  for (int k = -3; k <= 3; ++k) {
    blocks.push_back(
        {"block", MeshBvh(make_mesh({"cube", 12})), Pose{Quaterniond::Identity(), {0.05 * k, 0, 0}}});
  }
  const Scene scene(mesh_tool(make_mesh({"cube", 12})), {}, {}, std::move(blocks));
  Proxy proxy(scene);
  Pose X_WQ = {Quaterniond::Identity(), {-0.12, 0, 0.0505}};
  for (int tick = 0; tick < 2400; ++tick) {
    const Pose X_WP = {Quaterniond::Identity(), {-0.12 + 1e-4 * tick, 0.003, 0.049}};
    const Projection q = proxy.follow(X_WP, X_WQ);
    X_WQ = q.X_WQ;
    INFO(tick);
    REQUIRE(q.X_WQ.translation_m.x() == Approx(X_WP.translation_m.x()).margin(1e-9));
    REQUIRE(q.X_WQ.translation_m.z() == Approx(0.05).margin(1e-8));
  }
}

TEST_CASE("thousands of obstacles cost as much as the near ones, and yield the same result", "[proxy]") {
  const auto cube = std::make_shared<const MeshBvh>(make_mesh({"cube", 12}));
  std::vector<MeshObstacle> few, many;
  for (int i = 0; i < 60; ++i)
    for (int j = 0; j < 60; ++j) {
      const Pose X_WO = {rotation_from({0.1 * i, 0.2 * j, 0.0}), {0.11 * (i - 30), 0.11 * (j - 30), 0.0}};
      many.emplace_back("cube", cube, X_WO);
      if (std::abs(i - 32) <= 4 && std::abs(j - 30) <= 3) few.emplace_back("cube", cube, X_WO);
    }
  const Scene small(mesh_tool(make_mesh({"bumpy", 500})), {}, {}, std::move(few));
  const Scene large(mesh_tool(make_mesh({"bumpy", 500})), {}, {}, std::move(many));
  Proxy a(small), b(large);
  Pose X_a = {Quaterniond::Identity(), {0, 0, 0.09}}, X_b = X_a;
  int contacts = 0;
  for (int tick = 0; tick < 1500; ++tick) {
    const double t = 1e-3 * tick;
    const Pose X_WP = {rotation_from({t, 0.3 * t, 0}), {0.25 * t, 0.03 * std::sin(9.0 * t), 0.06}};
    const Projection q_a = a.follow(X_WP, X_a), q_b = b.follow(X_WP, X_b);
    REQUIRE(q_a.X_WQ.translation_m == q_b.X_WQ.translation_m);
    REQUIRE(q_a.X_WQ.rotation.coeffs() == q_b.X_WQ.rotation.coeffs());
    contacts += in_contact(q_a) ? 1 : 0;
    X_a = q_a.X_WQ;
    X_b = q_b.X_WQ;
  }
  CHECK(contacts > 300);
}

TEST_CASE("half-spaces and meshes hold a proxy together", "[proxy]") {
  std::vector<MeshObstacle> obstacles;
  obstacles.push_back({"wall", MeshBvh(make_mesh({"cube", 12})), Pose{Quaterniond::Identity(), {0.1, 0, 0}}});
  const Scene scene(tool_body(make_mesh({"cube", 12}), 1.0, 0.1), {{"floor", Vector3d::UnitZ(), -0.03}}, {},
                    std::move(obstacles));
  Proxy proxy(scene);
  Pose X_WQ;
  const Pose X_WP = {Quaterniond::Identity(), {0.06, 0, -0.02}};
  const Projection q = proxy.follow(X_WP, X_WQ);
  CHECK(q.status == ProjectionStatus::converged);
  CHECK(q.X_WQ.translation_m.z() == Approx(-0.005).margin(1e-8));
  CHECK(q.X_WQ.translation_m.x() == Approx(0.05).margin(1e-8));
  bool floor = false, wall = false;
  for (const ActiveContact& active : q.active) (active.contact.obstacle == 0 ? floor : wall) = true;
  CHECK(floor);
  CHECK(wall);
}

TEST_CASE("a proxy without budget stays at an admissible pose and reports it", "[proxy]") {
  const ManipulationCase& handling = manipulation_cases()[7];
  const Scene scene = scene_of(handling);
  const ExactIntersection exact(scene.tool_mesh()->surface.mesh(), scene.meshes()[0].mesh->surface.mesh());
  Proxy::WorkLimit little;
  little.sweeps = 3;
  little.node_visits = 60;
  Proxy proxy(scene, little);
  Pose X_WQ = {Quaterniond::Identity(), handling.start_m};
  HandTrajectory hand(handling);
  int spent = 0;
  Pose X_WP;
  for (int tick = 0; tick < 400; ++tick) {
    X_WP = hand.next();
    const Projection q = proxy.follow(X_WP, X_WQ);
    spent += q.status == ProjectionStatus::budget_spent ? 1 : 0;
    X_WQ = q.X_WQ;
    REQUIRE_FALSE(exact.intersect(X_WQ));
    if (q.status == ProjectionStatus::budget_spent)
      REQUIRE(q.energy == Approx(energy(scene.tool().solid.inertia, X_WP, X_WQ)));
  }
  CHECK(spent > 5);
}

/// Node visits that fit the period of 1 ms (WorkBalancer): less work than this is never deferred.
constexpr std::uint32_t kUndeferred_visits = 7000;

/// Visits, answers and the largest work of ticks 0 and later.
struct FollowedTicks {
  std::uint32_t most = 0;
  std::vector<std::uint32_t> visits;
  std::vector<Projection> q;
  long late() const {
    return std::count_if(q.begin(), q.end(),
                         [](const Projection& at) { return at.status == ProjectionStatus::budget_spent; });
  }
};

/// hand: pose of the tool at a tick; ticks below 0 approach the obstacle.
template <class Hand>
FollowedTicks follow_ticks(const Scene& scene, const Pose& X_start, int first, int count, bool balanced,
                           const Hand& hand) {
  const ExactIntersection exact(scene.tool_mesh()->surface.mesh(), scene.meshes()[0].mesh->surface.mesh());
  Proxy::WorkLimit effort;
  effort.balanced = balanced;
  Proxy proxy(scene, effort);
  FollowedTicks out;
  Pose X_WQ = X_start;
  for (int tick = first; tick < count; ++tick) {
    const Projection q = proxy.follow(hand(tick), X_WQ);
    X_WQ = q.X_WQ;
    REQUIRE(q.status != ProjectionStatus::infeasible);
    if (tick < 0) continue;
    if (tick % 20 == 0) REQUIRE_FALSE(exact.intersect(X_WQ));
    out.visits.push_back(proxy.node_visits());
    out.most = std::max(out.most, proxy.node_visits());
    out.q.push_back(q);
  }
  return out;
}

// Back and forth along a boulder, pressed into it, with rests of 20 ticks. Each movement starts anew, without
// a candidate list for it.
TEST_CASE("bodies of 20,000 triangles never defer work", "[proxy]") {
  const Scene scene = scene_of({"fine bodies", {"bumpy", 20'000}, {"boulder", 20'000}, Handling::slide, {}});
  const auto hand = [](int tick) -> Pose {
    const int phase = std::max(tick, 0) / 60, within = std::min(std::max(tick, 0) % 60, 40);
    const double s = 1e-4 * (phase % 2 == 0 ? within : 40 - within);
    return {rotation_from({0.0, 3.0 * s, 2.0 * s}),
            {0.0915 + 5e-4 * std::max(-tick - 20, 0), s, -0.5 * s}};  // down onto the boulder before tick -20
  };
  const FollowedTicks ticks =
      follow_ticks(scene, {Quaterniond::Identity(), {0.12, 0, 0}}, -40, 600, true, hand);
  CHECK(ticks.late() == 0);
  CHECK(ticks.most < kUndeferred_visits);
  for (std::size_t i = 59; i < ticks.q.size(); i += 60) {  // the tool has rested
    CHECK(ticks.q[i].status == ProjectionStatus::converged);
    CHECK(ticks.q[i].kkt_residual < 1e-6);
  }
}

// The unit is node visits, not time. If the hand starts to move or reverses in a tight fit of fine bodies, a
// candidate list is missing. A tick that builds it immediately needs more than the period.
TEST_CASE("a tick that would exceed the period defers work, and the proxy catches up", "[proxy]") {
  const Scene scene = scene_of({"tight fit", {"peg", 20'000}, {"hole", 40'000}, Handling::slide, {}});
  const auto hand = [](int tick) -> Pose {
    const int phase = std::max(tick, 0) / 100, within = std::min(std::max(tick, 0) % 100, 40);
    const double s = 5e-5 * (phase % 2 == 0 ? within : 40 - within);
    return {rotation_from({0.0, 0.0, 20.0 * s}), {2.5e-4 * std::min(1.0, (tick + 60) / 40.0), 0.0, s}};
  };
  const Pose X_start;
  const FollowedTicks balanced = follow_ticks(scene, X_start, -60, 600, true, hand),
                      at_once = follow_ticks(scene, X_start, -60, 600, false, hand);
  CHECK(balanced.most < 0.75 * at_once.most);
  int run = 0;
  for (std::size_t i = 0; i < balanced.q.size(); ++i) {
    run = balanced.q[i].status == ProjectionStatus::budget_spent ? run + 1 : 0;
    CHECK(run <= 4);
    if (i % 100 != 99) continue;  // the tool has rested
    CHECK(balanced.q[i].status == ProjectionStatus::converged);
    CHECK(balanced.q[i].kkt_residual < 1e-6);
  }
  CHECK(balanced.late() > 0);
  CHECK(balanced.late() < 40);
}

/// From rest to 0.1 m/s, along and around a boulder at this distance from its centre.
std::vector<Projection> slid_along(double away_m, std::vector<std::uint32_t>& visits) {
  const Scene scene = scene_of({"fine bodies", {"bumpy", 20'000}, {"boulder", 20'000}, Handling::slide, {}});
  Proxy proxy(scene);
  std::vector<Projection> all;
  Pose X_WQ = {Quaterniond::Identity(), {0.13, 0, 0}};
  for (int tick = -300; tick < 700; ++tick) {
    const double t = tick < 0 ? 0.0 : tick < 100 ? 0.005 * tick * tick : tick - 50.0;
    const double angle = 1e-3 * t;
    const double r_m = away_m + 1e-4 * std::max(-tick - 50, 0) + 2e-4 * std::sin(0.02 * t);
    const Pose X_WP = {rotation_from({0.0, 0.3 * angle, -angle}),
                       {r_m * std::cos(angle), r_m * std::sin(angle), 0.0}};
    const Projection q = proxy.follow(X_WP, X_WQ);
    X_WQ = q.X_WQ;
    if (tick < 100) continue;
    visits.push_back(proxy.node_visits());
    all.push_back(q);
  }
  return all;
}

// Unit: node visits. Contacts begin and end along the path, and a tick that meets one sweeps several times.
TEST_CASE("ticks along a path need similar work", "[proxy]") {
  std::vector<std::uint32_t> visits;
  slid_along(0.1, visits);
  std::sort(visits.begin(), visits.end());
  const std::uint32_t usual = visits[visits.size() / 2];
  CHECK(visits[visits.size() * 99 / 100] <= 2 * usual);
  CHECK(visits.back() <= 3 * usual);
}

// Far inside, a small motion of the hand is a large motion of the tool, which cannot be predicted.
TEST_CASE("wrong predictions cost more work, but defer none that fits the period", "[proxy]") {
  std::vector<std::uint32_t> visits;
  const std::vector<Projection> all = slid_along(0.096, visits);
  const auto late = std::count_if(
      all.begin(), all.end(), [](const Projection& q) { return q.status == ProjectionStatus::budget_spent; });
  CHECK(late == 0);
  CHECK(*std::max_element(visits.begin(), visits.end()) < kUndeferred_visits);
}

TEST_CASE("following a hand through meshes neither allocates nor locks", "[realtime][proxy]") {
  for (const std::size_t i : {3, 7, 12, 15}) {
    const ManipulationCase& handling = manipulation_cases()[i];
    INFO(handling.name);
    const Scene scene = scene_of(handling);
    PenetrationDepth depth(scene, {});
    HandTrajectory hand(handling);
    Pose X_WQ = {Quaterniond::Identity(), handling.start_m};
    std::uint64_t allocations = 0, locks = 0;
    {
      const RealtimeGuard guard;
      for (int tick = 0; tick < 300; ++tick) X_WQ = depth.follow(hand.next(), X_WQ).projection.X_WQ;
      allocations = guard.allocations();
      locks = guard.locks();
    }
    CHECK(allocations == 0);
    CHECK(locks == 0);
  }
}

}  // namespace
}  // namespace wrenchd::test_proxy
