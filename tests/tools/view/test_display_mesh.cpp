// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <set>
#include <stdexcept>
#include <string>

#include <catch2/catch.hpp>

#include "collision/meshes/make_mesh.hpp"
#include "core/triangle_mesh.hpp"
#include "tests/support/sample_meshes.hpp"
#include "tools/view/display_mesh.hpp"

namespace wrenchd::test_display_mesh {

namespace {

DisplayMesh drawn(const TriangleMesh& mesh, std::size_t most = 1'000'000) {
  std::vector<float> vertices;
  for (const Vector3d& p : mesh.vertices_m)
    for (int i = 0; i < 3; ++i) vertices.push_back(static_cast<float>(p[i]));
  return display_mesh(vertices, mesh.triangles, most);
}

Vector3d third(const std::vector<float>& xs, std::size_t i) {
  return {xs[3 * i], xs[3 * i + 1], xs[3 * i + 2]};
}

/// Returns the normal at a corner of a triangle.
Vector3d position(const DisplayMesh& mesh, std::size_t i) {
  return third(mesh.positions, mesh.indices[i]);
}

double volume(const DisplayMesh& mesh) {
  double six = 0.0;
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3)
    six += position(mesh, i).dot(position(mesh, i + 1).cross(position(mesh, i + 2)));
  return six / 6.0;
}

}  // namespace

TEST_CASE("a cube is drawn flat, with its twelve edges", "[view]") {
  const DisplayMesh cube = drawn(make_mesh({.kind = "cube", .triangles = 12, .seed = 1}));
  REQUIRE(cube.triangles() >= 12);
  for (std::size_t t = 0; t < cube.triangles(); ++t) {
    const Vector3d a = position(cube, 3 * t), b = position(cube, 3 * t + 1), c = position(cube, 3 * t + 2);
    const Vector3d n = (b - a).cross(c - a).normalized();
    for (std::size_t k = 0; k < 3; ++k)
      CHECK((third(cube.normals, cube.indices[3 * t + k]) - n).norm() < 1e-5);
  }
  double length = 0.0, side = 0.0;
  for (std::size_t i = 0; i + 1 < cube.lines.size() / 3; i += 2)
    length += (third(cube.lines, i + 1) - third(cube.lines, i)).norm();
  for (const float x : cube.positions) side = std::max(side, 2.0 * std::abs(static_cast<double>(x)));
  CHECK(length == Approx(12.0 * side));
}

TEST_CASE("a sphere is drawn smooth, without an edge", "[view]") {
  const DisplayMesh sphere = drawn(make_mesh({.kind = "sphere", .triangles = 5000, .seed = 1}));
  CHECK(sphere.lines.empty());
  CHECK(sphere.positions.size() / 3 < sphere.triangles());  // corners are shared
  double worst = 1.0;
  for (std::size_t i = 0; i < sphere.positions.size() / 3; ++i)
    worst = std::min(worst, third(sphere.positions, i).normalized().dot(third(sphere.normals, i)));
  CHECK(worst > std::cos(0.05));
}

TEST_CASE("a large mesh is drawn with fewer triangles, and keeps its shape", "[view]") {
  for (const char* kind : {"sphere", "cube", "gear"}) {
    const TriangleMesh fine = make_mesh({.kind = kind, .triangles = 60'000, .seed = 1});
    const double whole = volume(drawn(fine));
    const DisplayMesh coarse = drawn(fine, 8'000);
    INFO(kind);
    CHECK(coarse.source_triangles == fine.triangles.size());
    CHECK(coarse.triangles() <= 8'000);
    CHECK(coarse.triangles() > 2'000);
    CHECK(volume(coarse) == Approx(whole).epsilon(0.01));
    const bool round = std::string(kind) == "sphere";
    const double lines_a_triangle =
        static_cast<double>(coarse.lines.size()) / 6.0 / static_cast<double>(coarse.triangles());
    CHECK((lines_a_triangle < 0.001) == round);  // a round body has nearly no edges
    CHECK(drawn(fine, fine.triangles.size()).triangles() == fine.triangles.size());
  }
}

TEST_CASE("a triangle that names a missing vertex is rejected", "[view]") {
  const std::vector<float> vertices(9, 0.0F);
  const std::vector<std::array<std::uint32_t, 3>> triangles = {{0, 1, 3}};
  CHECK_THROWS_AS(display_mesh(vertices, triangles, 10), std::invalid_argument);
}

}  // namespace wrenchd::test_display_mesh
