// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <CGAL/AABB_face_graph_triangle_primitive.h>
#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Side_of_triangle_mesh.h>
#include <CGAL/Surface_mesh.h>
#include <Eigen/Geometry>
#include <catch2/catch.hpp>

#include "collision/meshes/make_mesh.hpp"
#include "collision/meshes/mesh_simplifier.hpp"
#include "collision/meshes/mesh_surface.hpp"
#include "core/inertia.hpp"
#include "tests/support/case_count.hpp"

namespace wrenchd::test_mesh_simplifier {

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Surface = CGAL::Surface_mesh<Kernel::Point_3>;
using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, CGAL::AABB_face_graph_triangle_primitive<Surface>>>;

constexpr double kTolerance_m = 1e-6;

Kernel::Point_3 point(const Vector3d& p) {
  return {p.x(), p.y(), p.z()};
}

Surface surface_of(const TriangleMesh& mesh) {
  Surface surface;
  for (const Vector3d& p : mesh.vertices_m) surface.add_vertex(point(p));
  using Vertex = Surface::Vertex_index;
  for (const auto& [a, b, c] : mesh.triangles) surface.add_face(Vertex(a), Vertex(b), Vertex(c));
  return surface;
}

TriangleMesh rotated(TriangleMesh mesh) {
  const Quaterniond rotation = Quaterniond(0.8, 0.3, -0.2, 0.47).normalized();
  for (Vector3d& p : mesh.vertices_m) p = rotation * p;
  return mesh;
}

/// A file in millimetres and single precision.
TriangleMesh rounded(TriangleMesh mesh) {
  for (Vector3d& p : mesh.vertices_m)
    for (double& x : p) x = 1e-3 * static_cast<double>(static_cast<float>(1e3 * x));
  return mesh;
}

/// Points of a surface: the corners, middles of edges and centroids of its triangles.
std::vector<Vector3d> samples_of(const TriangleMesh& mesh, std::size_t stride) {
  std::vector<Vector3d> points;
  for (std::size_t t = 0; t < mesh.triangles.size(); t += stride) {
    const auto& [i, j, k] = mesh.triangles[t];
    const Vector3d &a = mesh.vertices_m[i], &b = mesh.vertices_m[j], &c = mesh.vertices_m[k];
    points.insert(points.end(), {a, 0.5 * (a + b), 0.5 * (b + c), (a + b + c) / 3.0});
  }
  return points;
}

struct Comparison {
  double farthest_m = 0.0;  ///< largest distance of the simplified surface from the original
  double deepest_m = 0.0;   ///< largest depth of the simplified surface inside the original solid
};

/// Measures the simplified surface against the original with CGAL.
Comparison compare(const TriangleMesh& original, const TriangleMesh& simplified) {
  const Surface surface = surface_of(original);
  Tree tree(faces(surface).begin(), faces(surface).end(), surface);
  const CGAL::Side_of_triangle_mesh<Surface, Kernel> side_of(surface);
  Comparison result;
  for (const Vector3d& p :
       samples_of(simplified, std::max<std::size_t>(1, simplified.triangles.size() / 3000))) {
    const double distance_m = std::sqrt(tree.squared_distance(point(p)));
    result.farthest_m = std::max(result.farthest_m, distance_m);
    if (side_of(point(p)) == CGAL::ON_BOUNDED_SIDE) result.deepest_m = std::max(result.deepest_m, distance_m);
  }
  return result;
}

void check_encloses(const TriangleMesh& fine, const SimplifiedMesh& simple) {
  CHECK(simple.mesh.triangles.size() <= fine.triangles.size());
  CHECK(simple.distance_m <= kTolerance_m);
  const Surface surface = surface_of(simple.mesh);
  REQUIRE(surface.number_of_faces() == simple.mesh.triangles.size());
  CHECK(CGAL::is_closed(surface));
  CHECK_FALSE(CGAL::Polygon_mesh_processing::does_self_intersect(surface));
  const Comparison measured = compare(fine, simple.mesh);
  CHECK(measured.farthest_m <= simple.distance_m + 1e-12);
  CHECK(measured.deepest_m < 3e-10);
  CHECK(solid_properties(simple.mesh, 1.0).volume_m3 > solid_properties(fine, 1.0).volume_m3 * (1.0 - 1e-9));
}

}  // namespace

TEST_CASE("a cube has twelve triangles, however finely its faces are cut", "[mesh_simplifier]") {
  const auto check = [](const TriangleMesh& fine, double rounding_m) {
    const SimplifiedMesh cube = simplify_enclosing(fine, kTolerance_m);
    CHECK(cube.mesh.triangles.size() == 12);
    CHECK(cube.distance_m <= rounding_m);
    CHECK(std::abs(solid_properties(cube.mesh, 1.0).volume_m3 - 1.25e-4) <
          8.0 * 0.0075 * (rounding_m + 1e-15));
    const Comparison measured = compare(fine, cube.mesh);
    CHECK(measured.farthest_m <= cube.distance_m + 1e-12);
    CHECK(measured.deepest_m < 1e-12);
  };
  check(make_mesh({"cube", 3000}), 1e-12);
  check(rotated(make_mesh({"cube", 20000})), 1e-12);
  check(rounded(make_mesh({"cube", 3000})), 2e-8);
  check(rounded(rotated(make_mesh({"cube", 20000}))), 2e-8);
}

TEST_CASE("the simplified surface encloses the solid within the stated distance", "[mesh_simplifier]") {
  for (const std::string kind :
       {"peg", "hole", "gear", "dowel", "socket", "bolt", "nut", "key", "lock", "hare"}) {
    INFO(kind);
    for (const TriangleMesh& fine : {make_mesh({kind, 20000}), rounded(rotated(make_mesh({kind, 20000})))}) {
      check_encloses(fine, simplify_enclosing(fine, kTolerance_m));
    }
  }
}

TEST_CASE("a surface that is simplified in parts, on several processors, is as good as one in one piece",
          "[mesh_simplifier]") {
  const auto large = [](int triangles) { return static_cast<std::size_t>(test::case_count(triangles)); };
  for (const TriangleMesh& cube :
       {make_mesh({"cube", large(400'000)}), rounded(rotated(make_mesh({"cube", large(400'000)})))})
    CHECK(simplify_enclosing(cube, kTolerance_m).mesh.triangles.size() == 12);
  for (const std::string kind : {"hole", "hare"}) {
    INFO(kind);
    const TriangleMesh fine = rounded(rotated(make_mesh({kind, large(250'000)})));
    const SimplifiedMesh simple = simplify_enclosing(fine, kTolerance_m);
    CHECK(simple.mesh.triangles.size() < fine.triangles.size());
    check_encloses(fine, simple);
    const SimplifiedMesh again = simplify_enclosing(fine, kTolerance_m);
    CHECK(again.mesh.triangles == simple.mesh.triangles);
    CHECK(again.mesh.vertices_m == simple.mesh.vertices_m);
    CHECK(again.source_vertex == simple.source_vertex);
  }
}

TEST_CASE("a larger tolerance leaves fewer triangles", "[mesh_simplifier]") {
  const TriangleMesh ball = make_mesh({"sphere", 20000});
  std::size_t last = ball.triangles.size() + 1;
  for (const double tolerance_m : {1e-6, 1e-4, 1e-3, 5e-3}) {
    const SimplifiedMesh simple = simplify_enclosing(ball, tolerance_m);
    CHECK(simple.mesh.triangles.size() < last);
    CHECK(simple.distance_m <= tolerance_m);
    CHECK(compare(ball, simple.mesh).deepest_m < 3e-10);
    last = simple.mesh.triangles.size();
  }
  CHECK(last < 2000);
}

TEST_CASE("vertices and triangles know where they come from", "[mesh_simplifier]") {
  const TriangleMesh fine = make_mesh({"gear", 20000});
  const SimplifiedMesh simple = simplify_enclosing(fine, kTolerance_m);
  REQUIRE(simple.source_vertex.size() == simple.mesh.vertices_m.size());
  REQUIRE(simple.source_triangle.size() == simple.mesh.triangles.size());
  for (std::size_t v = 0; v < simple.source_vertex.size(); ++v)
    CHECK((fine.vertices_m[simple.source_vertex[v]] - simple.mesh.vertices_m[v]).norm() < 1e-4);
  const auto normal = [](const TriangleMesh& mesh, std::size_t t) -> Vector3d {
    const auto& [a, b, c] = mesh.triangles[t];
    return (mesh.vertices_m[b] - mesh.vertices_m[a])
        .cross(mesh.vertices_m[c] - mesh.vertices_m[a])
        .normalized();
  };
  for (std::size_t t = 0; t < simple.source_triangle.size(); ++t)
    CHECK(normal(simple.mesh, t).dot(normal(fine, simple.source_triangle[t])) > 0.99);
}

TEST_CASE("what is no closed manifold stays as it is", "[mesh_simplifier]") {
  TriangleMesh open = make_mesh({"cube", 3000});
  open.triangles.pop_back();
  CHECK(simplify_enclosing(open, kTolerance_m).mesh.triangles == open.triangles);
  CHECK(simplify_enclosing(TriangleMesh{}, kTolerance_m).mesh.triangles.empty());
  const TriangleMesh coarse = make_mesh({"sphere", 320});
  const SimplifiedMesh same = simplify_enclosing(coarse, kTolerance_m);
  CHECK(same.mesh.vertices_m == coarse.vertices_m);
  CHECK(same.mesh.triangles == coarse.triangles);
  CHECK(same.distance_m == 0.0);
}

TEST_CASE("two walls closer together than the tolerance do not grow into each other", "[mesh_simplifier]") {
  // A ball with a thin spherical gap inside: the wall of the gap faces the ball's core.
  TriangleMesh shells = make_mesh({"sphere", 20000});
  const auto add_shell = [&](double radius, bool cavity) {
    const TriangleMesh ball = make_mesh({"sphere", 20000});
    const auto first = static_cast<std::uint32_t>(shells.vertices_m.size());
    for (const Vector3d& p : ball.vertices_m) shells.vertices_m.push_back(radius * p);
    for (const auto& [a, b, c] : ball.triangles)
      shells.triangles.push_back(cavity ? std::array{first + a, first + c, first + b}
                                        : std::array{first + a, first + b, first + c});
  };
  add_shell(0.5 + 1e-3, true);
  add_shell(0.5, false);
  const SimplifiedMesh simple = simplify_enclosing(shells, 1e-3);  // the gap is 30 um
  CHECK_FALSE(CGAL::Polygon_mesh_processing::does_self_intersect(surface_of(simple.mesh)));
}

TEST_CASE("the tolerance follows single precision and the size", "[mesh_simplifier]") {
  TriangleMesh cube = make_mesh({"cube", 12});
  CHECK(simplification_tolerance_m(cube, 1e-6) == 1e-6);
  for (Vector3d& p : cube.vertices_m) p *= 0.01;
  CHECK(simplification_tolerance_m(cube, 1e-6) < 1e-7);  // a part of 0.5 mm
  for (Vector3d& p : cube.vertices_m) p = 1e4 * p + Vector3d(100, 0, 0);
  CHECK(simplification_tolerance_m(cube, 1e-6) > 5e-6);  // 100 m from the origin
  CHECK(simplification_tolerance_m(TriangleMesh{}, 1e-6) == 0.0);
}

}  // namespace wrenchd::test_mesh_simplifier
