// SPDX-License-Identifier: GPL-3.0-or-later
#include <set>
#include <tuple>

#include <catch2/catch.hpp>

#include "collision/pairs/candidate_pairs.hpp"
#include "collision/pairs/triangle_intersection.hpp"
#include "tests/support/case_count.hpp"
#include "tests/support/manipulation_case.hpp"

namespace wrenchd::test_candidate_pairs {

namespace {

using namespace test;

constexpr std::uint32_t kPlenty = 10000000;

using PairSet = std::set<std::tuple<std::uint32_t, std::uint32_t, std::uint32_t>>;

PairSet make_state_set(const CandidatePairs& list) {
  PairSet out;
  for (const CandidatePair& pair : list.pairs()) out.insert({pair.a, pair.b, pair.obstacle});
  return out;
}

void list_all(CandidatePairs& list, const CandidatePairs::Path& path) {
  VisitBudget budget = {kPlenty};
  list.start(path);
  REQUIRE(list.resume(budget));
  REQUIRE(list.complete());
}

/// Returns a pose at this distance from a path.
Pose near_way(RandomValues& random, const CandidatePairs::Path& path, double away_m, double radius_m) {
  const double share = random.uniform(0.0, 1.0), of_shift = random.uniform(0.0, 1.0);
  const Pose on_way = {
      path.X_WT_start.rotation.slerp(share, path.X_WT_end.rotation),
      path.X_WT_start.translation_m + share * (path.X_WT_end.translation_m - path.X_WT_start.translation_m)};
  return {(on_way.rotation * random.rotation((1.0 - of_shift) * away_m / radius_m)).normalized(),
          on_way.translation_m + of_shift * away_m * random.unit<3>()};
}

TEST_CASE("a list built in parts equals a list built at once", "[candidate_pairs]") {
  const Scene scene = scene_of(manipulation_cases()[7]);
  const CandidatePairs::Path path = {
      {Quaterniond::Identity(), {0.10, 0, 0}}, {rotation_from({0.0, 0.01, 0.0}), {0.099, 0.001, 0}}, 1e-4};
  CandidatePairs at_once(scene), in_parts(scene);
  list_all(at_once, path);
  in_parts.start(path);
  int parts = 0;
  for (VisitBudget few = {7}; !in_parts.resume(few); few = {7}) {
    CHECK(in_parts.in_progress());
    CHECK_FALSE(in_parts.covers(path.X_WT_start));
    ++parts;
  }
  CHECK(parts > 5);
  CHECK(in_parts.complete());
  CHECK(in_parts.node_visits() == at_once.node_visits());
  CHECK(make_state_set(in_parts) == make_state_set(at_once));
  CHECK(at_once.pairs().size() > 10);
}

// A list that covers a pose contains all pairs of a list for that pose alone, except for pairs that only its
// margins include. The triangles themselves decide about those.
TEST_CASE("a list contains the pairs that meet anywhere near its path", "[candidate_pairs]") {
  RandomValues random(31);
  std::size_t looked_at = 0;
  for (const std::size_t i : {2, 7, 11, 14}) {
    const ManipulationCase& handling = manipulation_cases()[i];
    INFO(handling.name);
    const Scene scene = scene_of(handling);
    const double r_m = scene.tool_radius_m();
    const MeshSurface& tool = scene.tool_mesh()->surface;
    const MeshSurface& obstacle = scene.meshes()[0].mesh->surface;
    CandidatePairs list(scene), here(scene);
    for (int n = 0; n < case_count(20); ++n) {
      const Pose X_start = {random.rotation(0.2), random.uniform(0.0, 1.0) * handling.start_m};
      const CandidatePairs::Path path = {
          X_start,
          {(X_start.rotation * random.rotation(random.uniform(0.0, 0.2))).normalized(),
           X_start.translation_m + random.uniform(0.0, 0.003) * random.unit<3>()},
          random.log_uniform(1e-5, 1e-3)};
      list_all(list, path);
      const PairSet listed = make_state_set(list);
      for (int k = 0; k < 5; ++k) {
        const Pose X_WT = near_way(random, path, 0.7 * path.reach_m, r_m);
        REQUIRE(list.covers(X_WT));
        list_all(here, {X_WT, X_WT, 0.0});
        for (const CandidatePair& pair : here.pairs()) {
          const auto corner = [&](int c) -> Vector3d { return X_WT * tool.corner_m(pair.a, c); };
          if (!triangles_intersect(
                  {corner(0), corner(1), corner(2)},
                  {obstacle.corner_m(pair.b, 0), obstacle.corner_m(pair.b, 1), obstacle.corner_m(pair.b, 2)}))
            continue;
          ++looked_at;
          CHECK(listed.count({pair.a, pair.b, pair.obstacle}) == 1);
        }
      }
    }
  }
  CHECK(looked_at > 100);
}

TEST_CASE("poses beyond the reach of the path are not covered", "[candidate_pairs]") {
  RandomValues random(32);
  const Scene scene = scene_of(manipulation_cases()[8]);
  const double r_m = scene.tool_radius_m();
  const CandidatePairs::Path path = {
      {Quaterniond::Identity(), {0.08, 0, 0}}, {rotation_from({0.0, 0.02, 0.01}), {0.08, 0.002, 0}}, 1e-4};
  CandidatePairs list(scene);
  CHECK_FALSE(list.covers(path.X_WT_start));  // the list is empty
  list_all(list, path);
  CHECK(list.covers(path.X_WT_start));
  CHECK(list.covers(path.X_WT_end));
  for (const Vector3d& away : {Vector3d(1, 0, 0), Vector3d(0, -1, 0), Vector3d(0, 0, 1)}) {
    const auto beside = [&](double share) {
      return Pose{path.X_WT_start.rotation, path.X_WT_start.translation_m + share * path.reach_m * away};
    };
    CHECK(list.covers(beside(0.99)));
    CHECK_FALSE(list.covers(beside(1.5)));
    const auto turned = [&](double share) {
      return Pose{path.X_WT_start.rotation * rotation_from(-share * path.reach_m / r_m * away),
                  path.X_WT_start.translation_m};
    };
    CHECK_FALSE(list.covers(turned(1.5)));
  }
}

TEST_CASE("of thousands of obstacles only nearby ones are listed", "[candidate_pairs]") {
  std::vector<MeshObstacle> obstacles;
  const MeshBvh cube(make_mesh({"cube", 12}));
  for (int x = 0; x < 10; ++x)
    for (int y = 0; y < 10; ++y)
      obstacles.push_back({"cube", cube, Pose{Quaterniond::Identity(), {x * 1.0, y * 1.0, 0.0}}});
  const Scene scene(mesh_tool(make_mesh({"cube", 12})), {}, {}, std::move(obstacles));
  CandidatePairs list(scene);
  const Pose X_WT = {Quaterniond::Identity(), {3.0, 4.0, 0.055}};
  list_all(list, {X_WT, X_WT, 0.01});
  CHECK(list.nearby_obstacles().size() == 1);
  for (const CandidatePair& pair : list.pairs()) CHECK(pair.obstacle == 34);
  CHECK_FALSE(list.pairs().empty());
}

// A tool at rest, and a ball that passes 2 mm above it.
TEST_CASE("a list with a moving obstacle covers its times and its relative path", "[candidate_pairs]") {
  const ObstacleMotion flies = {{0.5, 0, 0}, {0, 0, 20.0}, 0.0};
  std::vector<MeshObstacle> obstacles;
  const auto ball = std::make_shared<const MeshBvh>(make_mesh({"sphere", 320}));
  obstacles.emplace_back("ball", ball, Pose{Quaterniond::Identity(), {-0.502, 0, 0.062}}, flies);
  const Scene scene(mesh_tool(make_mesh({"sphere", 320})), {}, {}, std::move(obstacles));
  const Pose X_WT;
  CandidatePairs list(scene);
  const CandidatePairs::Path path = {X_WT, X_WT, 0.003, 1.000, 1.002};
  list_all(list, path);
  CHECK(list.covers(X_WT, 1.0));
  CHECK(list.covers(X_WT, 1.001));
  CHECK(list.covers(X_WT, 1.002));
  CHECK_FALSE(list.covers(X_WT, 0.999));
  CHECK_FALSE(list.covers(X_WT, 1.003));
  CHECK_FALSE(list.covers(Pose{Quaterniond::Identity(), {0, 0, 0.004}}, 1.001));
  // In the frame of the ball the tool rotates. The reach around the path in the world does not suffice.
  const CandidatePairs::Path short_way = {X_WT, X_WT, 1e-5, 1.000, 1.010};
  list_all(list, short_way);
  CHECK(list.covers(X_WT, 1.0));
  CHECK_FALSE(list.covers(X_WT, 1.005));  // the distance between arc and chord exceeds 10 um
}

}  // namespace
}  // namespace wrenchd::test_candidate_pairs
