// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <numbers>
#include <set>

#include <catch2/catch.hpp>

#include "collision/meshes/make_mesh.hpp"
#include "collision/meshes/mesh_surface.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_mesh_surface {

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
  // A surface has two sides. The inner edge is convex seen from inside; its ends are convex from no side.
  const MeshSurface skin(angle_iron(), Kind::surface);
  CHECK(convex_vertex_count(skin) == 10);
  CHECK(length_of_edges(skin) == Approx(2 * 8.0 + 6 * 1.0));
}

TEST_CASE("a closed mesh as a surface has the convex features of the solid and those seen from inside",
          "[mesh_surface]") {
  for (const char* kind : {"cube", "bumpy", "gear", "hole"}) {
    const TriangleMesh mesh = make_mesh({kind, 2000});
    const MeshSurface solid(mesh, Kind::solid), surface(mesh, Kind::surface);
    std::map<std::array<std::uint32_t, 2>, MeshSurface::Edge> edges;
    for (const auto& edge : surface.convex_edges()) edges.insert({edge.vertices, edge});
    std::size_t common = 0;
    for (const auto& edge : solid.convex_edges()) {
      REQUIRE(edges.count(edge.vertices) == 1);
      const MeshSurface::Edge& same = edges.at(edge.vertices);
      CHECK(same.triangles == edge.triangles);
      CHECK(surface.outward(same) == solid.outward(edge));
      ++common;
    }
    // Edges that are convex from inside: their outward direction points into the solid.
    for (const auto& edge : surface.convex_edges()) common -= edge.sides[0] > 0 ? 1 : 0;
    CHECK(common == 0);
    for (std::uint32_t v = 0; v < mesh.vertices_m.size(); ++v)
      if (!solid.ring_of(v).empty()) CHECK(surface.ring_of(v).size() == solid.ring_of(v).size());
  }
}

/// Rectangles that share the edge from (0, 0, 0) to (0, 1, 0), one in each direction given by its angle in
/// the x-z plane.
MeshSurface fan(const std::vector<double>& angles) {
  TriangleMesh mesh;
  mesh.vertices_m = {{0, 0, 0}, {0, 1, 0}};
  for (const double angle : angles) {
    const auto a = static_cast<std::uint32_t>(mesh.vertices_m.size());
    const Vector3d out(std::cos(angle), 0.0, std::sin(angle));
    mesh.vertices_m.push_back(out);
    mesh.vertices_m.push_back(out + Vector3d::UnitY());
    if (a % 4 == 0)  // every second one is wound the other way
      mesh.triangles.insert(mesh.triangles.end(), {{0, 1, a}, {1, a + 1, a}});
    else
      mesh.triangles.insert(mesh.triangles.end(), {{1, 0, a}, {1, a, a + 1}});
  }
  return MeshSurface(mesh, Kind::surface);
}

TEST_CASE("an edge of a surface is convex seen from its sector of more than 180 degrees", "[mesh_surface]") {
  const auto common_edge = [](const MeshSurface& surface) {
    std::vector<MeshSurface::Edge> found;
    for (const auto& edge : surface.convex_edges())
      if (edge.vertices[0] < 2 && edge.vertices[1] < 2) found.push_back(edge);
    return found;
  };
  const double degree = std::numbers::pi / 180.0;
  struct Case {
    std::vector<double> degrees;
    double outward;  ///< direction of the middle of the wide sector [degrees]
    bool convex, border;
  };
  for (const Case& c : std::vector<Case>{{{0}, 180, true, true},
                                         {{0, 90}, 225, true, false},
                                         {{0, 270}, 135, true, false},
                                         {{0, 179}, 269.5, true, false},
                                         {{0, 180}, 0, false, false},
                                         {{0, 180, 270}, 0, false, false},
                                         {{0, 120, 240}, 0, false, false},
                                         {{0, 40, 110}, 235, true, false},
                                         {{40, 110, 0}, 235, true, false},
                                         {{0, 30, 60, 90}, 225, true, false},
                                         {{0, 90, 180, 270}, 0, false, false}}) {
    std::vector<double> angles;
    for (const double angle : c.degrees) angles.push_back(angle * degree);
    const MeshSurface surface = fan(angles);
    const auto found = common_edge(surface);
    INFO(c.degrees.size() << " faces, the second at " << c.degrees.back());
    REQUIRE(found.size() == (c.convex ? 1 : 0));
    if (!c.convex) continue;
    CHECK(found[0].is_border() == c.border);
    CHECK(surface.triangles()[found[0].triangles[0]][0] < 2);
    if (c.border) continue;
    const Vector3d middle(std::cos(c.outward * degree), 0.0, std::sin(c.outward * degree));
    CHECK(surface.outward(found[0]).normalized().isApprox(middle, 1e-9));
  }
}

TEST_CASE("a flat region of a surface has no interior features, however it is wound", "[mesh_surface]") {
  TriangleMesh mesh;
  constexpr std::uint32_t n = 6;
  for (std::uint32_t i = 0; i <= n; ++i)
    for (std::uint32_t j = 0; j <= n; ++j) mesh.vertices_m.emplace_back(0.1 * i, 0.1 * j, 0.0);
  RandomValues random(5);
  for (std::uint32_t i = 0; i < n; ++i)
    for (std::uint32_t j = 0; j < n; ++j) {
      const std::uint32_t a = i * (n + 1) + j, b = a + n + 1;
      mesh.triangles.push_back({a, b, b + 1});
      mesh.triangles.push_back({a, b + 1, a + 1});
    }
  for (auto& corners : mesh.triangles)
    if (random.chance(0.5)) std::swap(corners[1], corners[2]);
  const MeshSurface surface(mesh, Kind::surface);
  CHECK(length_of_edges(surface) == Approx(4 * 0.6));
  for (const auto& edge : surface.convex_edges()) CHECK(edge.is_border());
  CHECK(convex_vertex_count(surface) == 4);
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    CHECK(surface.planar_region(t) == surface.planar_region(0));
    const Vector3d area = (surface.corner_m(t, 1) - surface.corner_m(t, 0))
                              .cross(surface.corner_m(t, 2) - surface.corner_m(t, 0));
    CHECK(surface.planes()[t].normal.dot(area) > 0.0);  // the plane follows the winding of its triangle
  }
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
TEST_CASE("from each side a closed surface has the features of the solid on that side, and no others",
          "[mesh_surface]") {
  for (const TriangleMesh& mesh : {angle_iron(), make_mesh({"boulder", 2000}), make_mesh({"gear", 2000})}) {
    TriangleMesh inside_out = mesh;
    for (auto& corners : inside_out.triangles) std::swap(corners[1], corners[2]);
    const MeshSurface surface(mesh, Kind::surface);
    REQUIRE(surface.is_closed());
    using Features = std::set<std::array<std::uint32_t, 2>>;
    const auto features_from = [](const MeshSurface& body, unsigned side) {
      Features out;
      for (const MeshSurface::Features& features : body.features()) {
        for (const std::uint32_t v : features.vertices)
          if (v != MeshSurface::kNone && (body.sides_of_vertex(v) & side) != 0) out.insert({v, v});
        for (const std::uint32_t e : features.edges) {
          if (e == MeshSurface::kNone || (body.sides_of(body.convex_edges()[e]) & side) == 0) continue;
          auto ends = body.convex_edges()[e].vertices;
          std::sort(ends.begin(), ends.end());
          out.insert(ends);
        }
      }
      return out;
    };
    const Features front = features_from(MeshSurface(mesh, Kind::solid), MeshSurface::kFront);
    const Features back = features_from(MeshSurface(inside_out, Kind::solid), MeshSurface::kFront);
    const auto missing = [](const Features& some, const Features& from) {
      Features out;
      std::set_difference(from.begin(), from.end(), some.begin(), some.end(), std::inserter(out, out.end()));
      return out;
    };
    const auto check = [&](unsigned side, const Features& of_solid) {
      const Features of_surface = features_from(surface, side);
      CHECK(missing(of_solid, of_surface) == Features());
      // A solid also keeps tips of pits from which three convex edges rise. No body can touch them.
      for (const auto& [v, w] : missing(of_surface, of_solid)) {
        CHECK(v == w);
        CHECK(surface.sides_of_vertex(v) == MeshSurface::kBothSides - side);
      }
    };
    check(MeshSurface::kFront, front);
    check(MeshSurface::kBack, back);
    CHECK(!front.empty());
    CHECK(!back.empty());
    // A surface that is not closed has no front: every feature counts from both sides.
    TriangleMesh open = mesh;
    open.triangles.pop_back();
    const MeshSurface sheet(open, Kind::surface);
    CHECK(missing(features_from(sheet, MeshSurface::kFront), features_from(sheet, MeshSurface::kBack)) ==
          Features());
    CHECK(missing(features_from(sheet, MeshSurface::kBack), features_from(sheet, MeshSurface::kFront)) ==
          Features());
  }
}

}  // namespace wrenchd::test_mesh_surface
