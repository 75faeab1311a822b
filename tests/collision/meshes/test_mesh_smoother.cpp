// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <set>
#include <utility>

#include <catch2/catch.hpp>

#include "collision/meshes/make_mesh.hpp"
#include "collision/meshes/mesh_check.hpp"
#include "collision/meshes/mesh_file.hpp"
#include "collision/meshes/mesh_smoother.hpp"
#include "tests/support/paths.hpp"

namespace wrenchd::test_mesh_smoother {

namespace {

constexpr Smoothing kMost = {1e-3, 100'000};

Vector3d normal_of(const TriangleMesh& mesh, std::size_t face) {
  const auto& [a, b, c] = mesh.triangles[face];
  return (mesh.vertices_m[b] - mesh.vertices_m[a])
      .cross(mesh.vertices_m[c] - mesh.vertices_m[a])
      .normalized();
}

double volume_m3(const TriangleMesh& mesh) {
  double sum = 0.0;
  for (const auto& [a, b, c] : mesh.triangles)
    sum += mesh.vertices_m[a].dot(mesh.vertices_m[b].cross(mesh.vertices_m[c])) / 6.0;
  return sum;
}

/// A cylinder about z with rims of n vertices.
TriangleMesh cylinder(std::uint32_t n, double radius_m, double half_length_m) {
  TriangleMesh mesh;
  for (const double z_m : {-half_length_m, half_length_m})
    for (std::uint32_t i = 0; i < n; ++i) {
      const double angle = 2.0 * std::numbers::pi * i / n;
      mesh.vertices_m.emplace_back(radius_m * std::cos(angle), radius_m * std::sin(angle), z_m);
    }
  mesh.vertices_m.emplace_back(0.0, 0.0, -half_length_m);
  mesh.vertices_m.emplace_back(0.0, 0.0, half_length_m);
  for (std::uint32_t i = 0; i < n; ++i) {
    const std::uint32_t j = (i + 1) % n;
    mesh.triangles.push_back({i, j, n + i});
    mesh.triangles.push_back({j, n + j, n + i});
    mesh.triangles.push_back({2 * n, j, i});
    mesh.triangles.push_back({2 * n + 1, n + i, n + j});
  }
  return mesh;
}

}  // namespace

TEST_CASE("a smoothed sphere is round", "[mesh_smoother]") {
  const TriangleMesh coarse = make_mesh({"sphere", 1000});
  const double radius_m = coarse.vertices_m.front().norm();
  const double exact_m3 = 4.0 / 3.0 * std::numbers::pi * std::pow(radius_m, 3);
  const SimplifiedMesh smooth = smoothed(coarse, kMost);
  const double error_before = 1.0 - volume_m3(coarse) / exact_m3;
  const double error_after = 1.0 - volume_m3(smooth.mesh) / exact_m3;
  INFO(error_before << " to " << error_after);
  CHECK(error_before > 5e-3);
  CHECK(std::abs(error_after) < error_before / 50.0);
  for (const Vector3d& p : smooth.mesh.vertices_m) REQUIRE(std::abs(p.norm() - radius_m) < 2e-6);
  CHECK(smooth.distance_m > 100e-6);  // the height of its facets
  CHECK(smooth.distance_m < 300e-6);
}

TEST_CASE("flat faces and sharp edges stay as they are", "[mesh_smoother]") {
  const TriangleMesh cube = make_mesh({"cube", 12});
  const SimplifiedMesh same = smoothed(cube, kMost);
  CHECK(same.mesh.triangles == cube.triangles);
  CHECK(same.mesh.vertices_m == cube.vertices_m);
  CHECK(same.distance_m == 0.0);
}

TEST_CASE("the rim of a smoothed cylinder is a circle, and its caps stay flat", "[mesh_smoother]") {
  constexpr double kRadius_m = 0.01, kHalf_m = 0.02;
  const TriangleMesh coarse = cylinder(32, kRadius_m, kHalf_m);
  const SimplifiedMesh smooth = smoothed(coarse, kMost);
  double least_m = 1.0;
  for (const Vector3d& p : smooth.mesh.vertices_m) {
    REQUIRE(std::abs(p.z()) <= kHalf_m + 1e-12);
    if (std::abs(p.z()) < kHalf_m - 1e-12 || p.head<2>().norm() > 0.99 * kRadius_m)
      least_m = std::min(least_m, p.head<2>().norm());
  }
  const double facet_m = kRadius_m * (1.0 - std::cos(std::numbers::pi / 32));
  CHECK(facet_m > 45e-6);
  CHECK(kRadius_m - least_m < 0.5e-6);
  CHECK(volume_m3(smooth.mesh) ==
        Approx(std::numbers::pi * kRadius_m * kRadius_m * 2.0 * kHalf_m).epsilon(1e-4));
}

TEST_CASE("a smoothed solid is closed, does not intersect itself and keeps its sides", "[mesh_smoother]") {
  const auto* const kind = GENERATE("sphere", "bumpy", "bolt", "nut", "gear", "bowl", "boulder");
  const TriangleMesh coarse = make_mesh({kind, 600, 3});
  const SimplifiedMesh smooth = smoothed(coarse, kMost);
  INFO(kind << ": " << coarse.triangles.size() << " to " << smooth.mesh.triangles.size() << " triangles");
  CHECK(smooth.mesh.triangles.size() <= kMost.max_triangles);
  CHECK(smooth.mesh.triangles.size() == smooth.source_triangle.size());
  CHECK(smooth.mesh.vertices_m.size() == smooth.source_vertex.size());
  std::set<std::pair<std::uint32_t, std::uint32_t>> edges;
  for (const auto& [a, b, c] : smooth.mesh.triangles)
    for (const auto& edge : {std::pair(a, b), std::pair(b, c), std::pair(c, a)})
      REQUIRE(edges.insert(edge).second);
  for (const auto& [a, b] : edges) REQUIRE(edges.contains({b, a}));
  for (std::size_t i = 0; i < smooth.mesh.triangles.size(); ++i)
    REQUIRE(normal_of(smooth.mesh, i).dot(normal_of(coarse, smooth.source_triangle[i])) > 0.5);
  for (std::size_t v = 0; v < coarse.vertices_m.size(); ++v)
    REQUIRE(smooth.mesh.vertices_m[v] == coarse.vertices_m[v]);
}

TEST_CASE("a smoothed solid passes the check of solids", "[mesh_smoother][long]") {
  const auto* const kind = GENERATE("bumpy", "bolt", "nut", "gear");
  const SimplifiedMesh smooth = smoothed(make_mesh({kind, 2000, 3}), kMost);
  PolygonSoup soup{smooth.mesh.vertices_m, {}};
  for (const auto& [a, b, c] : smooth.mesh.triangles) soup.faces.push_back({a, b, c});
  TriangleMesh checked;
  const MeshReport report = repair_and_check_solid(soup, &checked);
  INFO(kind);
  CHECK(report.defects.empty());
  CHECK(report.repairs.empty());
  CHECK(report.tolerated.empty());
}

TEST_CASE("nothing moves farther than permitted", "[mesh_smoother]") {
  const double most_m = GENERATE(1e-6, 20e-6, 100e-6);
  const TriangleMesh coarse = make_mesh({"bumpy", 500, 2});
  const SimplifiedMesh smooth = smoothed(coarse, {most_m});
  CHECK(smooth.distance_m <= most_m * (1.0 + 1e-9));
  CHECK(smooth.distance_m > 0.9 * most_m);
  for (std::size_t i = 0; i < smooth.mesh.triangles.size(); ++i) {
    const std::uint32_t face = smooth.source_triangle[i];
    const Vector3d n = normal_of(coarse, face);
    const Vector3d& origin = coarse.vertices_m[coarse.triangles[face][0]];
    for (const std::uint32_t v : smooth.mesh.triangles[i])
      REQUIRE(std::abs(n.dot(smooth.mesh.vertices_m[v] - origin)) <= most_m * (1.0 + 1e-9));
  }
}

TEST_CASE("a surface with a border is smoothed too", "[mesh_smoother]") {
  TriangleMesh open = make_mesh({"sphere", 500});
  std::erase_if(open.triangles, [&](const auto& t) { return open.vertices_m[t[0]].z() > 0.01; });
  const SimplifiedMesh smooth = smoothed(open, kMost);
  CHECK(smooth.mesh.triangles.size() > 20 * open.triangles.size());
  for (std::size_t i = 0; i < smooth.mesh.triangles.size(); ++i)
    REQUIRE(normal_of(smooth.mesh, i).dot(normal_of(open, smooth.source_triangle[i])) > 0.5);
}

TEST_CASE("a large mesh is divided less", "[mesh_smoother]") {
  const TriangleMesh large = make_mesh({"bumpy", 60000, 2});
  constexpr Smoothing kFine = {1e-3, Smoothing::kMaxTrianglesForHalfSpaces};
  const SimplifiedMesh smooth = smoothed(large, kFine);
  CHECK(smooth.mesh.triangles.size() <= kFine.max_triangles);
  CHECK(smooth.mesh.triangles.size() > large.triangles.size());
}

}  // namespace wrenchd::test_mesh_smoother
