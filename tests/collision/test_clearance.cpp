// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include <catch2/catch.hpp>

#include "collision/clearance.hpp"
#include "collision/meshes/make_mesh.hpp"
#include "collision/pairs/triangle_intersection.hpp"
#include "collision/pose_solver.hpp"
#include "collision/tool_body.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_clearance {

using namespace wrenchd::test;

namespace {

/// Returns the point of a triangle nearest to p by a search over barycentric coordinates that halves its
/// step: slow, and unlike the code under test.
Vector3d nearest_by_search(const Vector3d& p, const Triangle& t) {
  double u = 0.3, v = 0.3;
  const auto point = [&t](double a, double b) {
    return Vector3d(t[0] + a * (t[1] - t[0]) + b * (t[2] - t[0]));
  };
  for (double step = 0.5; step > 1e-10;) {
    double best = (point(u, v) - p).squaredNorm(), best_u = u, best_v = v;
    for (const auto& [du, dv] :
         {std::pair{1.0, 0.0}, {-1.0, 0.0}, {0.0, 1.0}, {0.0, -1.0}, {1.0, -1.0}, {-1.0, 1.0}}) {
      const double a = std::clamp(u + step * du, 0.0, 1.0);
      const double b = std::clamp(v + step * dv, 0.0, 1.0 - a);
      const double squared = (point(a, b) - p).squaredNorm();
      if (squared < best) best = squared, best_u = a, best_v = b;
    }
    if (best_u == u && best_v == v) step /= 2.0;
    u = best_u, v = best_v;
  }
  return point(u, v);
}

/// Returns an upper bound of the distance of two triangles by alternating projections. It converges to the
/// distance, slowly if the nearest points lie on nearly parallel faces.
double distance_by_alternation(const Triangle& a, const Triangle& b) {
  Vector3d p = (a[0] + a[1] + a[2]) / 3.0, q = p;
  for (int i = 0; i < 200; ++i) q = nearest_by_search(p, b), p = nearest_by_search(q, a);
  return (p - q).norm();
}

Triangle random_triangle(RandomValues& random, double spread_m) {
  Triangle t;
  for (Vector3d& p : t) p = random.vector<3>();
  const Vector3d shift = spread_m * random.vector<3>();
  for (Vector3d& p : t) p += shift;
  return t;
}

Scene scene_of(const std::string& tool, const std::string& obstacle, std::uint32_t triangles) {
  const auto mesh = [triangles](const std::string& kind) {
    GeneratedMesh made;
    made.kind = kind;
    made.triangles = triangles;
    return make_mesh(made);
  };
  ToolBody body = tool_body(mesh(tool), 1.0, 1.0);
  return Scene(std::move(body), {}, {},
               {MeshObstacle("one", std::make_shared<const MeshBvh>(mesh(obstacle)), Pose{})});
}

}  // namespace

TEST_CASE("the distance of two triangles is that of a slow search", "[clearance]") {
  RandomValues random(3);
  int apart = 0;
  for (int i = 0; i < 100; ++i) {
    const Triangle a = random_triangle(random, 1.0), b = random_triangle(random, 1.0);
    if (triangles_intersect(a, b)) continue;
    ++apart;
    const double found = triangle_distance_m(a, b), searched = distance_by_alternation(a, b);
    INFO("case " << i);
    CHECK(found <= searched + 1e-9);
    CHECK(found >= searched - 2e-3 * (1.0 + searched));
    CHECK(triangle_distance_m(b, a) == Approx(found).margin(1e-12));
  }
  CHECK(apart > 30);
}

TEST_CASE("triangles without area have a distance", "[clearance]") {
  const Triangle point = {Vector3d::Zero(), Vector3d::Zero(), Vector3d::Zero()};
  const Triangle line = {Vector3d(1, -1, 0), Vector3d(1, 1, 0), Vector3d(1, 1, 0)};
  CHECK(triangle_distance_m(point, line) == Approx(1.0));
  CHECK(triangle_distance_m(line, point) == Approx(1.0));
  CHECK(triangle_distance_m(point, point) == 0.0);
}

TEST_CASE("the clearance of meshes is the least distance of all pairs of triangles", "[clearance]") {
  RandomValues random(5);
  for (const auto& [tool, obstacle] : {std::pair{"bumpy", "bumpy"}, {"gear", "sphere"}}) {
    const Scene scene = scene_of(tool, obstacle, 300);
    const MeshBvh& a = *scene.tool_mesh();
    const MeshBvh& b = *scene.meshes().front().mesh;
    for (int i = 0; i < 5; ++i) {
      const Vector3d direction = random.vector<3>().normalized();
      const Pose X_WT{random.rotation(),
                      (scene.tool_radius_m() + scene.meshes().front().radius_m + 0.002) * direction};
      double least = std::numeric_limits<double>::infinity();
      for (std::uint32_t k = 0; k < a.surface.triangles().size(); ++k) {
        Triangle of_a;
        for (int c = 0; c < 3; ++c) of_a[static_cast<std::size_t>(c)] = X_WT * a.surface.corner_m(k, c);
        for (std::uint32_t l = 0; l < b.surface.triangles().size(); ++l)
          least =
              std::min(least, triangle_distance_m(of_a, {b.surface.corner_m(l, 0), b.surface.corner_m(l, 1),
                                                         b.surface.corner_m(l, 2)}));
      }
      CHECK(clearance_m(scene, X_WT, 0.0) == Approx(least).margin(1e-14));
      CHECK(surface_distance_m(a, b, X_WT, 0.5 * least) == 0.5 * least);
    }
  }
}

TEST_CASE("a pose that overlaps has no clearance, and one that is free has some",
          "[clearance][pose_solver]") {
  const Scene scene = scene_of("bumpy", "bumpy", 500);
  PoseSolver solver(scene, {});
  RandomValues random(8);
  int overlapping = 0, free = 0;
  for (int i = 0; i < 60; ++i) {
    const Pose X_WM{random.rotation(), scene.tool_radius_m() * random.vector<3>()};
    const bool overlaps = solver.overlaps(X_WM);
    CHECK((solver.clearance_m(X_WM) == 0.0) == overlaps);
    CHECK((solver.project(X_WM).penetration.projection.status == ProjectionStatus::free) == !overlaps);
    ++(overlaps ? overlapping : free);
  }
  CHECK(overlapping > 5);
  CHECK(free > 5);
}

}  // namespace wrenchd::test_clearance
