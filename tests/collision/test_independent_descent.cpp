// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "collision/meshes/make_mesh.hpp"
#include "collision/proxy.hpp"
#include "core/metric.hpp"
#include "tests/support/exact_intersection.hpp"
#include "tests/support/independent_descent.hpp"
#include "tests/support/manipulation_case.hpp"

namespace wrenchd::test_independent_descent {

using namespace wrenchd::test;

// The judge of prove_proxy --descents must be able to find a closer pose where there is one.
TEST_CASE("a random search finds the way down from a pose that is not the closest, and none from the closest",
          "[independent_descent]") {
  std::vector<MeshObstacle> obstacles;
  obstacles.push_back({"table", MeshBvh(make_mesh({"table", 12}), BodyKind::solid), Pose{}, {}});
  const Scene scene(mesh_tool(make_mesh({"cube", 12})), {}, {}, std::move(obstacles));
  const ExactIntersection exact(scene.tool_mesh()->surface.mesh(), scene.meshes()[0].mesh->surface.mesh());
  const Inertia& M = scene.tool().solid.inertia;

  Proxy proxy(scene);
  Pose X_WQ{rotation_from({0.02, -0.05, 0.3}), {0.01, 0.0, 0.05}};
  Pose X_WP = X_WQ;
  Projection q;
  for (int i = 0; i < 200; ++i) {
    X_WP.translation_m.z() -= 2e-4;
    q = proxy.follow(X_WP, X_WQ, 1e-3 * i);
    X_WQ = q.X_WQ;
  }
  REQUIRE(q.status == ProjectionStatus::converged);
  REQUIRE(q.active.size() > 0);
  const double optimum = energy(M, X_WP, X_WQ);
  const auto search = [&](const Pose& from) {
    return descend_at_random(exact, M, X_WP, from, Pose{}, Pose{}, 5, 2000);
  };
  CHECK(search(X_WQ) > (1.0 - 1e-5) * optimum);
  Pose raised = X_WQ;
  raised.translation_m.z() += 2e-4;
  REQUIRE(energy(M, X_WP, raised) > 1.01 * optimum);
  CHECK(search(raised) < 1.003 * optimum);
  CHECK(search(raised) > (1.0 - 1e-5) * optimum);
}

}  // namespace wrenchd::test_independent_descent
