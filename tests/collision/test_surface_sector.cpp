// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <catch2/catch.hpp>

#include "collision/surface_sector.hpp"
#include "tests/support/pocket_meshes.hpp"

namespace wrenchd::test_surface_sector {

namespace {

constexpr double kOver_m = 1e-9, kClearance_m = 1e-9, kStep_m = 1e-5;

/// A tray as a surface. inside_out: wound the other way.
MeshSurface tray_surface(bool inside_out) {
  TriangleMesh mesh = test::tray();
  if (inside_out)
    for (auto& corners : mesh.triangles) std::swap(corners[1], corners[2]);
  return MeshSurface(std::move(mesh), BodyKind::surface);
}

const MeshSurface::Edge& edge_between(const MeshSurface& surface, std::uint32_t a, std::uint32_t b) {
  for (const MeshSurface::Edge& edge : surface.convex_edges())
    if (edge.vertices == std::array{a, b} || edge.vertices == std::array{b, a}) return edge;
  throw std::logic_error("the surface has no convex edge between these vertices");
}

/// A triangle in the plane x = x_m, and that plane with its normal along +x or -x.
std::pair<std::uint32_t, MeshSurface::Plane> face_at_x(const MeshSurface& surface, double x_m,
                                                       double towards) {
  for (std::uint32_t t = 0; t < surface.triangles().size(); ++t)
    if (std::abs(surface.corner_m(t, 0).x() - x_m) < 1e-12 &&
        std::abs(std::abs(surface.planes()[t].normal.x()) - 1.0) < 1e-12)
      return {t, {towards * Vector3d::UnitX(), towards * x_m}};
  throw std::logic_error("the surface has no face there");
}

}  // namespace

TEST_CASE("a tool above the rim is behind the end of the tray's upright edge", "[surface_sector]") {
  const Vector3d diagonal = Vector3d(1.0, 1.0, 0.0).normalized(), up = Vector3d::UnitZ();
  for (const bool inside_out : {false, true}) {
    const MeshSurface surface = tray_surface(inside_out);
    const MeshSurface::Edge& in_tray = edge_between(surface, 10, 14);  // at (0.05, 0.05)
    const Vector3d rim(0.05, 0.05, 0.0);
    const auto is_behind = [&](const MeshSurface::Edge& edge, const Vector3d& n, const Vector3d& p) {
      return is_behind_end(surface, edge, p, p + kClearance_m * n, p + kStep_m * n);
    };
    CHECK(is_behind(in_tray, -diagonal, rim + kOver_m * up));
    // In the material, seen from which the edge is convex.
    CHECK_FALSE(is_behind(in_tray, diagonal, rim - 1e-3 * up));
    const MeshSurface::Edge& outside = edge_between(surface, 2, 6);  // at (0.07, 0.07)
    const Vector3d corner(0.07, 0.07, 0.0);
    CHECK_FALSE(is_behind(outside, diagonal, corner + kOver_m * up));
    CHECK_FALSE(is_behind(outside, diagonal, corner - 1e-3 * up));
  }
}

TEST_CASE("a vertex above the rim is behind the far side of a wall, and not behind the near side",
          "[surface_sector]") {
  for (const bool inside_out : {false, true}) {
    const MeshSurface surface = tray_surface(inside_out);
    for (const auto& [x_m, free_side] : {std::pair(0.07, 1.0), std::pair(0.05, -1.0)}) {
      INFO("wall at x = " << x_m);
      const Vector3d above(x_m, 0.01, kOver_m), below(x_m, 0.01, -kOver_m);
      const auto [near_face, near_plane] = face_at_x(surface, x_m, free_side);
      const auto [far_face, far_plane] = face_at_x(surface, x_m, -free_side);
      // One of the two triangles of the wall has the rim as its border.
      bool is_behind_far = false;
      for (std::uint32_t t = 0; t < surface.triangles().size(); ++t) {
        if (surface.planar_region(t) != surface.planar_region(near_face)) continue;
        CHECK_FALSE(is_behind_rim(surface, t, near_plane, above, above));
        is_behind_far = is_behind_far || is_behind_rim(surface, t, far_plane, above, above);
        CHECK_FALSE(is_behind_rim(surface, t, far_plane, below, below));
      }
      CHECK(is_behind_far);
      CHECK(far_face == near_face);
    }
  }
}

TEST_CASE("a tool that was in the corner of the tray at the start of its path stays in front of its walls",
          "[surface_sector]") {
  for (const bool inside_out : {false, true}) {
    const MeshSurface surface = tray_surface(inside_out);
    const auto [wall, inward] = face_at_x(surface, 0.05, -1.0);
    // The wall at y = 0.05 rises beside it. The tool passes the plane of the first wall a little behind the
    // second.
    const Vector3d beyond(0.05, 0.05 + kOver_m, -0.01);
    for (std::uint32_t t = 0; t < surface.triangles().size(); ++t) {
      if (surface.planar_region(t) != surface.planar_region(wall)) continue;
      CHECK_FALSE(is_behind_rim(surface, t, inward, beyond, beyond - Vector3d(kStep_m, kStep_m, 0.0)));
    }
    bool is_behind = false;
    for (std::uint32_t t = 0; t < surface.triangles().size(); ++t)
      is_behind =
          is_behind || (surface.planar_region(t) == surface.planar_region(wall) &&
                        is_behind_rim(surface, t, inward, beyond, beyond + Vector3d(-kStep_m, kStep_m, 0.0)));
    CHECK(is_behind);
    // The edge between the two walls is convex from inside the material. Above the rim there is no material.
    const MeshSurface::Edge& upright = edge_between(surface, 10, 14);
    const Vector3d diagonal = Vector3d(1.0, 1.0, 0.0).normalized(), rim(0.05, 0.05, kOver_m);
    CHECK_FALSE(is_behind_end(surface, upright, rim, rim + kClearance_m * diagonal,
                              rim + kStep_m * (diagonal - Vector3d::UnitZ())));
    CHECK(is_behind_end(surface, upright, rim, rim + kClearance_m * diagonal,
                        rim + kStep_m * (diagonal + Vector3d::UnitZ())));
  }
}

TEST_CASE("beyond the border of an open sheet nothing rises", "[surface_sector]") {
  TriangleMesh mesh;
  mesh.vertices_m = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  const MeshSurface sheet(mesh, BodyKind::surface);
  for (const double side : {1.0, -1.0})
    CHECK_FALSE(is_behind_rim(sheet, 0, {side * Vector3d::UnitZ(), 0.0}, {0.5, -1e-9, 1e-9 * side},
                              {0.5, 1e-3, 1e-3 * side}));
  CHECK_FALSE(
      is_behind_end(sheet, edge_between(sheet, 0, 1), {-1e-9, 0, 0}, {-1e-9, -1e-9, 0}, {-1e-9, -1e-3, 0}));
}

}  // namespace wrenchd::test_surface_sector
