// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "collision/meshes/make_mesh.hpp"
#include "collision/surface_sides.hpp"
#include "tests/support/manipulation_case.hpp"
#include "tests/support/pocket_meshes.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_surface_sides {

namespace {

using namespace test;

/// A closed surface that does not intersect itself. inside_out: wound the other way.
MeshBvh closed_surface(TriangleMesh mesh, bool inside_out) {
  if (inside_out)
    for (auto& corners : mesh.triangles) std::swap(corners[1], corners[2]);
  MeshBvh surface(std::move(mesh), BodyKind::surface);
  surface.divides_space = surface.surface.is_closed();
  return surface;
}

/// Returns the number of times that a surface winds around a point: the sum of the solid angles of its
/// triangles, divided by that of a sphere (van Oosterom and Strackee).
double winding_number(const TriangleMesh& mesh, const Vector3d& p) {
  double sum = 0.0;
  for (const auto& [i, j, k] : mesh.triangles) {
    const Vector3d a = mesh.vertices_m[i] - p, b = mesh.vertices_m[j] - p, c = mesh.vertices_m[k] - p;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    sum += 2.0 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return sum / (4.0 * std::numbers::pi);
}

/// A scene with one obstacle at x = 1 m that moves with 0.5 m/s along z.
Scene scene_with(TriangleMesh tool, MeshBvh obstacle) {
  ObstacleMotion motion;
  motion.linear_m_per_s = {0.0, 0.0, 0.5};
  std::vector<MeshObstacle> obstacles;
  obstacles.push_back({"shell", std::move(obstacle), {Quaterniond::Identity(), Vector3d::UnitX()}, motion});
  return Scene(mesh_tool(std::move(tool)), {}, {}, std::move(obstacles));
}

TriangleMesh scaled(TriangleMesh mesh, double factor, const Vector3d& shift = Vector3d::Zero()) {
  for (Vector3d& p : mesh.vertices_m) p = factor * p + shift;
  return mesh;
}

TriangleMesh together(TriangleMesh a, const TriangleMesh& b) {
  const auto first = static_cast<std::uint32_t>(a.vertices_m.size());
  a.vertices_m.insert(a.vertices_m.end(), b.vertices_m.begin(), b.vertices_m.end());
  for (const auto& [i, j, k] : b.triangles) a.triangles.push_back({i + first, j + first, k + first});
  return a;
}

}  // namespace

TEST_CASE("the side of a point is that of the winding number, also beside edges and vertices",
          "[surface_sides]") {
  RandomValues random(3);
  for (const TriangleMesh& mesh :
       {make_mesh({"cube", 12}), tray(), make_mesh({"boulder", 1000}), make_mesh({"gear", 1000})})
    for (const bool inside_out : {false, true}) {
      const MeshBvh surface = closed_surface(mesh, inside_out);
      REQUIRE(surface.divides_space);
      const unsigned outside = inside_out ? MeshSurface::kBack : MeshSurface::kFront;
      int inner = 0;
      for (int n = 0; n < 400; ++n) {
        // Near a vertex, near an edge, or anywhere.
        const auto t = static_cast<std::size_t>(random.uniform(0.0, 1.0) *
                                                static_cast<double>(mesh.triangles.size()) * (1.0 - 1e-12));
        const Vector3d& a = mesh.vertices_m[mesh.triangles[t][0]];
        const Vector3d& b = mesh.vertices_m[mesh.triangles[t][1]];
        const double r_m = surface.surface.radius_m();
        const std::array<Vector3d, 3> points = {
            a + 1e-6 * r_m * random.unit<3>(), 0.5 * (a + b) + 1e-6 * r_m * random.unit<3>(),
            1.1 * r_m * std::cbrt(random.uniform(0.0, 1.0)) * random.unit<3>()};
        for (const Vector3d& p : points) {
          const bool is_inside = winding_number(mesh, p) > 0.5;
          inner += is_inside ? 1 : 0;
          CHECK(side_of_point(surface, p) == (is_inside ? MeshSurface::kBothSides - outside : outside));
        }
      }
      CHECK(inner > 100);
    }
}

TEST_CASE("the tool is on the side where it was placed, at the obstacle's pose of that time",
          "[surface_sides]") {
  const TriangleMesh small = scaled(make_mesh({"cube", 12}), 0.05);
  const Scene scene = scene_with(small, closed_surface(make_mesh({"cube", 12}), false));
  SurfaceSides sides(scene, true);
  const Pose in_shell = {Quaterniond::Identity(), {1.0, 0.0, 0.5}};
  sides.set_admissible(in_shell, 1.0);  // the shell is at z = 0.5 m then
  CHECK_FALSE(sides.any_known());
  CHECK(sides.of(0) == MeshSurface::kBack);
  CHECK(sides.any_known());
  sides.set_admissible(in_shell, 9.0);
  CHECK(sides.of(0) == MeshSurface::kBack);  // until the tool is placed elsewhere
  sides.forget();
  CHECK_FALSE(sides.any_known());
  CHECK(sides.of(0) == MeshSurface::kFront);
}

TEST_CASE("a tool is on both sides if it may be anywhere next, or if tool or surface does not stay on one",
          "[surface_sides]") {
  const TriangleMesh cube = make_mesh({"cube", 12}), small = scaled(cube, 0.05);
  const auto sides_of = [](const Scene& scene, bool motion_is_continuous) {
    SurfaceSides sides(scene, motion_is_continuous);
    sides.set_admissible(Pose{}, 0.0);
    const unsigned out = sides.of(0);
    CHECK(sides.any_known() == (out != MeshSurface::kBothSides));
    return out;
  };
  const Scene scene = scene_with(small, closed_surface(cube, false));
  CHECK(sides_of(scene, true) == MeshSurface::kFront);
  CHECK(sides_of(scene, false) == MeshSurface::kBothSides);
  const TriangleMesh two_parts = together(small, scaled(cube, 0.05, Vector3d::UnitX()));
  CHECK(sides_of(scene_with(two_parts, closed_surface(cube, false)), true) == MeshSurface::kBothSides);
  const auto closed = [](const TriangleMesh& mesh) {
    return MeshSurface(mesh, BodyKind::surface).is_closed();
  };
  CHECK(closed(cube));
  CHECK_FALSE(closed(two_parts));
  TriangleMesh open = cube;
  open.triangles.pop_back();
  CHECK_FALSE(closed(open));
  TriangleMesh wound_otherwise = cube;
  std::swap(wound_otherwise.triangles[3][0], wound_otherwise.triangles[3][1]);
  CHECK_FALSE(closed(wound_otherwise));
  CHECK(sides_of(scene_with(small, closed_surface(open, false)), true) == MeshSurface::kBothSides);
}

}  // namespace wrenchd::test_surface_sides
