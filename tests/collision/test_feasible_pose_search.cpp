// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "collision/feasible_pose_search.hpp"
#include "core/metric.hpp"
#include "tests/support/case_count.hpp"
#include "tests/support/exact_intersection.hpp"
#include "tests/support/manipulation_case.hpp"

namespace wrenchd::test_feasible_pose_search {

namespace {

using namespace test;

TEST_CASE("a pose is admissible if nothing overlaps and no body contains another", "[feasible_pose_search]") {
  std::vector<MeshObstacle> obstacles;
  obstacles.push_back(
      {"boulder", MeshBvh(make_mesh({"boulder", 2000})), Pose{Quaterniond::Identity(), {1, 0, 0}}});
  const Scene scene(tool_body(make_mesh({"cube", 12}), 1.0, 0.1), {{"floor", Vector3d::UnitZ(), -0.5}}, {},
                    std::move(obstacles));
  FeasiblePoseSearch search(scene);
  CHECK(search.admissible({Quaterniond::Identity(), {0.9, 0, 0}}));
  CHECK_FALSE(search.admissible({Quaterniond::Identity(), {0.95, 0, 0}}));  // the surfaces intersect
  CHECK_FALSE(search.admissible({Quaterniond::Identity(), {1, 0, 0}}));     // completely inside
  CHECK_FALSE(search.admissible({Quaterniond::Identity(), {0, 0, -0.48}}));
  CHECK(search.admissible({Quaterniond::Identity(), {0, 0, -0.47}}));
}

TEST_CASE("a tool around an obstacle is not admissible either", "[feasible_pose_search]") {
  std::vector<MeshObstacle> obstacles;
  obstacles.push_back({"bolt", MeshBvh(make_mesh({"bolt", 500})), Pose{}});
  const Scene scene(mesh_tool(make_mesh({"cube", 12})), {}, {}, std::move(obstacles));
  CHECK_FALSE(FeasiblePoseSearch(scene).admissible(Pose{}));
}

TEST_CASE("from inside an obstacle the search finds a near admissible pose", "[feasible_pose_search]") {
  RandomValues random(9);
  for (const std::size_t i : {0, 2, 7, 11, 12}) {
    const ManipulationCase& handling = manipulation_cases()[i];
    INFO(handling.name);
    const Scene scene = scene_of(handling);
    const ExactIntersection exact(scene.tool_mesh()->surface.mesh(), scene.meshes()[0].mesh->surface.mesh());
    FeasiblePoseSearch search(scene);
    for (int n = 0; n < case_count(4); ++n) {
      const Pose X_WP = {random.rotation(),
                         random.uniform(0.0, 0.7) * handling.start_m.norm() * random.unit<3>()};
      const Projection q = search.nearest(X_WP);
      REQUIRE(q.status != ProjectionStatus::infeasible);
      CHECK(search.admissible(q.X_WQ));
      CHECK_FALSE(exact.intersect(q.X_WQ));
      CHECK(q.energy == Approx(energy(scene.tool().solid.inertia, X_WP, q.X_WQ)).margin(1e-15));
      // The result is at most as far as the nearest of some thousand random poses.
      for (int k = 0; k < case_count(300); ++k) {
        const Pose X = {(X_WP.rotation * random.rotation(random.uniform(0.0, 0.5))).normalized(),
                        X_WP.translation_m + random.uniform(0.0, 0.1) * random.unit<3>()};
        if (energy(scene.tool().solid.inertia, X_WP, X) < 0.999 * q.energy) CHECK_FALSE(search.admissible(X));
      }
    }
  }
}

TEST_CASE("a peg in its hole stays there", "[feasible_pose_search]") {
  const Scene scene = scene_of(manipulation_cases()[15]);
  FeasiblePoseSearch search(scene);
  const Pose X_WP = {rotation_from({0.002, 0.001, 0.3}), {0.0003, 0.0001, 0.002}};
  const Projection q = search.nearest(X_WP);
  REQUIRE(q.status == ProjectionStatus::converged);
  CHECK((q.X_WQ.translation_m - X_WP.translation_m).norm() < 0.0003);
}

}  // namespace
}  // namespace wrenchd::test_feasible_pose_search
