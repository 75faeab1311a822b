// SPDX-License-Identifier: GPL-3.0-or-later
#include <memory>

#include <catch2/catch.hpp>

#include "collision/meshes/make_mesh.hpp"
#include "collision/query_cost.hpp"
#include "tests/support/manipulation_case.hpp"

namespace wrenchd::test_query_cost {

namespace {

Scene scene_of(const GeneratedMesh& tool, const GeneratedMesh& obstacle, const ObstacleMotion& motion = {}) {
  std::vector<MeshObstacle> obstacles;
  obstacles.push_back({"obstacle", MeshBvh(make_mesh(obstacle)), Pose{}, motion});
  return Scene(test::mesh_tool(make_mesh(tool)), {}, {}, std::move(obstacles));
}

}  // namespace

TEST_CASE("a query costs more where the meshes are finer", "[query_cost]") {
  const QueryCost coarse = estimate_query_cost(scene_of({"cube", 12}, {"cube", 12}), 20.0);
  const QueryCost fine = estimate_query_cost(scene_of({"bumpy", 20000}, {"boulder", 20000}), 20.0);
  for (const QueryCost& cost : {coarse, fine}) {
    CHECK(cost.ticks > 1000);
    CHECK(cost.p99_visits <= cost.most_visits);
    CHECK(cost.p99_s <= cost.longest_s);
    CHECK(cost.p99_s > 0.0);
  }
  CHECK(fine.p99_visits > 3 * coarse.p99_visits);
}

TEST_CASE("the motions of the estimate are the same in every run", "[query_cost]") {
  const Scene scene = scene_of({"gear", 2000}, {"gear", 2000});
  const QueryCost a = estimate_query_cost(scene, 60.0), b = estimate_query_cost(scene, 60.0);
  CHECK(a.ticks == b.ticks);
  CHECK(a.p99_visits == b.p99_visits);
  CHECK(a.most_visits == b.most_visits);
}

TEST_CASE("the estimate ends with its time", "[query_cost]") {
  CHECK(estimate_query_cost(scene_of({"cube", 12}, {"cube", 12}), 0.0).ticks == 0);
}

TEST_CASE("there is no estimate without mesh obstacles at rest", "[query_cost]") {
  CHECK(estimate_query_cost(Scene(test::mesh_tool(make_mesh({"cube", 12})), {}), 1.0).ticks == 0);
  ObstacleMotion motion;
  motion.linear_m_per_s = Vector3d(0.1, 0, 0);
  CHECK(estimate_query_cost(scene_of({"cube", 12}, {"cube", 12}, motion), 1.0).ticks == 0);
}

}  // namespace wrenchd::test_query_cost
