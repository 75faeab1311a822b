// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <set>

#include <catch2/catch.hpp>

#include "collision/meshes/make_mesh.hpp"
#include "collision/meshes/mesh_surface.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd {
namespace {

using namespace test;
using Kind = MeshSurface::Kind;

std::size_t convex_vertex_count(const MeshSurface& surface) {
  std::size_t count = 0;
  for (const MeshSurface::Features& features : surface.features())
    for (const std::uint32_t vertex : features.vertices) count += vertex != MeshSurface::kNone ? 1 : 0;
  return count;
}

/// An L in the x-z plane, 1 deep in y: the inner edge runs along y through (1, ., 1).
TriangleMesh angle_iron() {
  const std::vector<std::pair<double, double>> outline = {{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}};
  TriangleMesh mesh;
  for (const double y : {0.0, 1.0})
    for (const auto& [x, z] : outline) mesh.vertices_m.emplace_back(x, y, z);
  for (std::uint32_t i = 0; i < 6; ++i) {
    const std::uint32_t j = (i + 1) % 6;
    mesh.triangles.push_back({i, j, j + 6});
    mesh.triangles.push_back({i, j + 6, i + 6});
  }
  for (const auto& [a, b, c] :
       {std::array{0U, 1U, 2U}, std::array{0U, 2U, 3U}, std::array{0U, 3U, 4U}, std::array{0U, 4U, 5U}}) {
    mesh.triangles.push_back({a, c, b});
    mesh.triangles.push_back({a + 6, b + 6, c + 6});
  }
  for (auto& [a, b, c] : mesh.triangles) std::swap(b, c);
  return mesh;
}

double length_of_edges(const MeshSurface& surface) {
  double sum = 0.0;
  for (const auto& edge : surface.convex_edges())
    sum += (surface.vertices_m()[edge.vertices[0]] - surface.vertices_m()[edge.vertices[1]]).norm();
  return sum;
}

TEST_CASE("a cube has eight convex vertices and twelve convex edges at every triangulation",
          "[mesh_surface]") {
  for (const std::size_t triangles : {12, 300, 5000}) {
    const MeshSurface cube(make_mesh({"cube", triangles}), Kind::solid);
    CHECK(convex_vertex_count(cube) == 8);
    CHECK(length_of_edges(cube) == Approx(12 * 0.05));
    std::set<std::array<double, 4>> planes;
    for (const auto& [n, offset] : cube.planes()) planes.insert({n.x(), n.y(), n.z(), offset});
    CHECK(planes.size() == 6);  // equal bit for bit
  }
}

TEST_CASE("the bottom of a groove has neither a convex edge nor a convex vertex", "[mesh_surface]") {
  const MeshSurface iron(angle_iron(), Kind::solid);
  CHECK(convex_vertex_count(iron) == 10);  // the two ends of the inner edge are not convex
  CHECK(length_of_edges(iron) == Approx(2 * 8.0 + 5 * 1.0));
  for (const auto& edge : iron.convex_edges()) {
    const Vector3d middle = 0.5 * (iron.vertices_m()[edge.vertices[0]] + iron.vertices_m()[edge.vertices[1]]);
    CHECK_FALSE((std::abs(middle.x() - 1) < 1e-9 && std::abs(middle.z() - 1) < 1e-9 &&
                 std::abs(middle.y() - 0.5) < 0.4));
  }
  // A surface has two sides, and all features count that are not inside a flat region.
  const MeshSurface skin(angle_iron(), Kind::surface);
  CHECK(convex_vertex_count(skin) == 12);
  CHECK(length_of_edges(skin) == Approx(2 * 8.0 + 6 * 1.0));
}

TEST_CASE("every convex vertex and every convex edge has one owner triangle, and lies in it",
          "[mesh_surface]") {
  for (const char* kind : {"bumpy", "gear", "bolt", "hole"}) {
    const MeshSurface surface(make_mesh({kind, 3000}), Kind::solid);
    std::multiset<std::uint32_t> vertices, edges;
    for (std::uint32_t t = 0; t < surface.triangles().size(); ++t) {
      for (std::size_t i = 0; i < 3; ++i) {
        const auto& f = surface.features()[t];
        if (f.vertices[i] != MeshSurface::kNone) {
          vertices.insert(f.vertices[i]);
          CHECK(surface.triangles()[t][i] == f.vertices[i]);
        }
        if (f.edges[i] != MeshSurface::kNone) {
          edges.insert(f.edges[i]);
          CHECK(surface.convex_edges()[f.edges[i]].triangles[0] == t);
          CHECK(surface.convex_edges()[f.edges[i]].vertices[0] == surface.triangles()[t][i]);
        }
      }
    }
    CHECK(vertices.size() == convex_vertex_count(surface));
    CHECK(edges.size() == surface.convex_edges().size());
    CHECK(std::set(vertices.begin(), vertices.end()).size() == vertices.size());
    CHECK(std::set(edges.begin(), edges.end()).size() == edges.size());
  }
}

// Brute force: a vertex is convex if one of many directions leaves all its neighbours, and so the solid,
// behind it.
TEST_CASE("every vertex that can meet a plane first is convex", "[mesh_surface]") {
  RandomValues random(3);
  for (const char* kind : {"bumpy", "gear", "peg"}) {
    const MeshSurface surface(make_mesh({kind, 1000}), Kind::solid);
    std::vector<std::set<std::uint32_t>> neighbours(surface.vertices_m().size());
    std::vector<Vector3d> normal(surface.vertices_m().size(), Vector3d::Zero());
    for (std::uint32_t t = 0; t < surface.triangles().size(); ++t)
      for (const std::uint32_t a : surface.triangles()[t]) {
        normal[a] += surface.planes()[t].normal;
        for (const std::uint32_t b : surface.triangles()[t])
          if (a != b) neighbours[a].insert(b);
      }
    std::size_t found = 0;
    for (std::uint32_t v = 0; v < surface.vertices_m().size(); ++v) {
      bool pointed = false;
      for (int k = 0; k < 200 && !pointed; ++k) {
        const Vector3d n =
            normal[v].normalized() + (k == 0 ? 0.0 : random.log_uniform(1e-3, 1.0)) * random.unit<3>();
        pointed = std::all_of(neighbours[v].begin(), neighbours[v].end(), [&](std::uint32_t w) {
          const Vector3d e = (surface.vertices_m()[w] - surface.vertices_m()[v]).normalized();
          return n.normalized().dot(e) < -1e-6;
        });
      }
      if (!pointed) continue;
      ++found;
      CHECK_FALSE(surface.ring_of(v).empty());
      CHECK(surface.ring_of(v).size() == neighbours[v].size());
    }
    CHECK(found > 0);
    CHECK(convex_vertex_count(surface) <= found + found / 20 + 2);  // few other vertices count as convex
  }
}

TEST_CASE("the border of an open mesh counts as an edge with one face", "[mesh_surface]") {
  TriangleMesh sheet;
  sheet.vertices_m = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  sheet.triangles = {{0, 1, 2}, {0, 2, 3}};
  const MeshSurface surface(sheet, Kind::surface);
  CHECK(surface.convex_edges().size() == 4);
  CHECK(convex_vertex_count(surface) == 4);
  for (const auto& edge : surface.convex_edges()) CHECK(edge.triangles[1] == MeshSurface::kNone);
}

}  // namespace
}  // namespace wrenchd
