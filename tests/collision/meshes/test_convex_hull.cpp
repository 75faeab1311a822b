// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <catch2/catch.hpp>

#include "collision/meshes/convex_hull.hpp"
#include "collision/meshes/make_mesh.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_convex_hull {

namespace {

double farthest_m(const std::vector<Vector3d>& points, const Vector3d& direction) {
  double most_m = -std::numeric_limits<double>::infinity();
  for (const Vector3d& p : points) most_m = std::max(most_m, direction.dot(p));
  return most_m;
}

/// Returns how far the mesh is outside of the hull [m]: the largest difference of their extents over the
/// normals of both, which decide, and over random directions.
double outside_m(const TriangleMesh& mesh, const ConvexBody& hull) {
  std::vector<Vector3d> directions;
  const TriangleMesh surface = hull_surface(hull);
  for (const TriangleMesh* faces : {&mesh, &surface})
    for (std::size_t t = 0; t < faces->triangles.size(); t += 1 + faces->triangles.size() / 500) {
      const auto& [i, j, k] = faces->triangles[t];
      const Vector3d area =
          (faces->vertices_m[j] - faces->vertices_m[i]).cross(faces->vertices_m[k] - faces->vertices_m[i]);
      if (area.norm() > 0.0) directions.push_back(area.normalized());
    }
  test::RandomValues random(7);
  for (int i = 0; i < 500; ++i) directions.push_back(random.unit<3>());
  double most_m = 0.0;
  for (const Vector3d& direction : directions)
    most_m =
        std::max(most_m, farthest_m(mesh.vertices_m, direction) - farthest_m(hull.vertices_T_m, direction));
  return most_m;
}

/// As a CAD program writes it: turned, in millimetres and single precision.
TriangleMesh turned_and_rounded(TriangleMesh mesh) {
  const Quaterniond rotation = Quaterniond(0.8, 0.3, -0.2, 0.47).normalized();
  for (Vector3d& p : mesh.vertices_m)
    for (double& x : p = rotation * p) x = 1e-3 * static_cast<double>(static_cast<float>(1e3 * x));
  return mesh;
}

}  // namespace

TEST_CASE("the hull of a mesh encloses it as the hull of its vertices does", "[convex_hull]") {
  for (const std::string kind :
       {"cube", "peg", "hole", "gear", "bolt", "nut", "sphere", "bumpy", "hare", "plate"})
    for (const TriangleMesh& mesh : {make_mesh({kind, 3000}), turned_and_rounded(make_mesh({kind, 3000}))}) {
      INFO(kind);
      const ConvexBody of_mesh = convex_hull(mesh), of_points = convex_hull(mesh.vertices_m);
      CHECK(outside_m(mesh, of_mesh) < 1e-15);
      CHECK(volume(of_mesh) == Approx(volume(of_points)).epsilon(1e-12));
      CHECK(of_mesh.vertices_T_m.size() <= of_points.vertices_T_m.size());
    }
}

TEST_CASE("the hull of a mesh keeps what has no neighbours", "[convex_hull]") {
  TriangleMesh cube = make_mesh({"cube", 200});
  cube.vertices_m.emplace_back(0.0, 0.0, 0.2);  // in no triangle
  CHECK(outside_m(cube, convex_hull(cube)) < 1e-15);
  TriangleMesh cloud{cube.vertices_m, {}};
  CHECK(volume(convex_hull(cloud)) == Approx(volume(convex_hull(cube))).epsilon(1e-12));
}

TEST_CASE("the hull of an open surface encloses its border", "[convex_hull]") {
  TriangleMesh bowl = make_mesh({"sphere", 3000});
  std::erase_if(bowl.triangles, [&](const auto& corners) { return bowl.vertices_m[corners[0]].z() > 0.005; });
  std::vector<bool> used(bowl.vertices_m.size(), false);
  for (const auto& corners : bowl.triangles)
    for (const std::uint32_t v : corners) used[v] = true;
  for (std::size_t v = 0; v < used.size(); ++v)
    if (!used[v]) bowl.vertices_m[v] = Vector3d(0.0, 0.0, -0.001);  // inside
  CHECK(outside_m(bowl, convex_hull(bowl)) < 1e-15);
}

TEST_CASE("the hull of a flat sheet has a volume", "[convex_hull]") {
  TriangleMesh sheet;
  constexpr std::uint32_t kSide = 12;
  for (std::uint32_t i = 0; i < kSide; ++i)
    for (std::uint32_t k = 0; k < kSide; ++k) {
      sheet.vertices_m.emplace_back(0.01 * i, 0.01 * k, 0.02);
      const std::uint32_t v = i * kSide + k;
      if (i == 0 || k == 0) continue;
      sheet.triangles.push_back({v, v - 1, v - kSide});
      sheet.triangles.push_back({v - 1, v - kSide - 1, v - kSide});
    }
  const ConvexBody hull = convex_hull(sheet);
  CHECK(volume(hull) > 0.0);
  CHECK(outside_m(sheet, hull) < 1e-15);
}

}  // namespace wrenchd::test_convex_hull
