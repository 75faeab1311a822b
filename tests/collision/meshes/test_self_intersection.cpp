// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <iterator>
#include <utility>
#include <vector>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Surface_mesh.h>
#include <catch2/catch.hpp>

#include "collision/meshes/make_mesh.hpp"
#include "collision/meshes/self_intersection.hpp"

namespace wrenchd::test_self_intersection {

namespace {

void append(TriangleMesh& mesh, const TriangleMesh& part, const Vector3d& by_m) {
  const auto first = static_cast<std::uint32_t>(mesh.vertices_m.size());
  for (const Vector3d& p : part.vertices_m) mesh.vertices_m.push_back(p + by_m);
  for (const auto& [a, b, c] : part.triangles) mesh.triangles.push_back({a + first, b + first, c + first});
}

/// The pairs that CGAL finds in one piece.
std::vector<TrianglePairNumbers> in_one_piece(const TriangleMesh& mesh) {
  using Surface = CGAL::Surface_mesh<CGAL::Exact_predicates_inexact_constructions_kernel::Point_3>;
  Surface surface;
  for (const Vector3d& p : mesh.vertices_m) surface.add_vertex({p.x(), p.y(), p.z()});
  using Vertex = Surface::Vertex_index;
  for (const auto& [a, b, c] : mesh.triangles) surface.add_face(Vertex(a), Vertex(b), Vertex(c));
  std::vector<std::pair<Surface::Face_index, Surface::Face_index>> found;
  CGAL::Polygon_mesh_processing::self_intersections(surface, std::back_inserter(found));
  std::vector<TrianglePairNumbers> pairs;
  for (const auto& [a, b] : found) pairs.push_back({std::min(a, b), std::max(a, b)});
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

}  // namespace

TEST_CASE("a large mesh that is tested in parts has the same intersections as in one piece",
          "[self_intersection]") {
  TriangleMesh mesh = make_mesh({"sphere", 60'000});
  double radius_m = 0.0;
  for (const Vector3d& p : mesh.vertices_m) radius_m = std::max(radius_m, p.norm());
  CHECK_FALSE(intersects_itself(mesh));
  CHECK(self_intersections(mesh, 100).empty());

  // The second sphere crosses the first one in a circle, which reaches through every dividing plane.
  append(mesh, make_mesh({"sphere", 60'000}), {0.3 * radius_m, 1.2 * radius_m, 0.1 * radius_m});
  CHECK(intersects_itself(mesh));
  const std::vector<TrianglePairNumbers> expected = in_one_piece(mesh);
  REQUIRE(expected.size() > 500);
  CHECK(self_intersections(mesh, 1'000'000) == expected);
  CHECK(self_intersections(mesh, 7).size() == 7);
}

TEST_CASE("spheres that do not touch do not intersect", "[self_intersection]") {
  TriangleMesh mesh = make_mesh({"sphere", 40'000});
  append(mesh, make_mesh({"sphere", 40'000}), {1.0, 0.0, 0.0});
  CHECK_FALSE(intersects_itself(mesh));
}

}  // namespace wrenchd::test_self_intersection
