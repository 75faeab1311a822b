// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <limits>
#include <vector>

#include "collision/meshes/convex_hull.hpp"
#include "collision/scene.hpp"
#include "collision/scene_contacts.hpp"
#include "core/inertia.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test {

/// Returns the surface of a convex body as outward-oriented triangles.
inline TriangleMesh surface_of(const ConvexBody& body) {
  TriangleMesh mesh;
  mesh.vertices_m = body.vertices_T_m;
  for (std::uint32_t v = 0; v < body.vertices_T_m.size(); ++v) {
    const auto ring = body.ring_of(v);
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const std::uint32_t a = ring[i];
      const std::uint32_t b = ring[(i + 1) % ring.size()];
      if (v < a && v < b) mesh.triangles.push_back({v, a, b});
    }
  }
  if (solid_properties(mesh, 1.0).volume_m3 < 0.0)
    for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

/// Returns a tool that is the convex hull of these points, as a uniform solid.
inline ToolBody tool_of(const std::vector<Vector3d>& points_M, double mass_kg = 1.0) {
  ToolBody tool;
  TriangleMesh mesh = surface_of(convex_hull(points_M));
  tool.solid = solid_properties(mesh, mass_kg);
  for (Vector3d& p : mesh.vertices_m) p -= tool.solid.p_MT_m;
  tool.hull = convex_hull(mesh.vertices_m);
  return tool;
}

/// Returns the corners of a box whose faces are divided into n x n squares.
inline std::vector<Vector3d> subdivided_box_points(int n, const Vector3d& size_m) {
  std::vector<Vector3d> points;
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j)
      for (const double side : {-0.5, 0.5}) {
        const double a = static_cast<double>(i) / n - 0.5;
        const double b = static_cast<double>(j) / n - 0.5;
        for (const Vector3d& p : {Vector3d(a, b, side), Vector3d(a, side, b), Vector3d(side, a, b)})
          points.push_back(p.cwiseProduct(size_m));
      }
  return points;
}

/// Returns a box with its centre at the origin of M.
inline ToolBody box(const Vector3d& size_m, double mass_kg = 1.0) {
  return tool_of(subdivided_box_points(1, size_m), mass_kg);
}

/// Returns the hull of points on an ellipsoid with random half-axes, compact or elongated.
inline ToolBody random_body(RandomValues& random, int points, double least_axis = 0.2) {
  const Vector3d axes(random.uniform(least_axis, 1.0), random.uniform(least_axis, 1.0),
                      random.uniform(least_axis, 1.0));
  std::vector<Vector3d> p;
  for (int i = 0; i < points; ++i) p.push_back(random.unit<3>().cwiseProduct(axes));
  return tool_of(p);
}

inline HalfSpaceSettings half_space(const Vector3d& normal, double offset_m) {
  return {"", normal.normalized(), offset_m};
}

/// Returns the smallest gap between the tool and any half-space of the scene [m]; negative if they overlap.
inline double least_gap_m(const Scene& scene, const Pose& X_WT) {
  double least = std::numeric_limits<double>::infinity();
  for (const HalfSpaceSettings& half_space : scene.half_spaces())
    for (const Vector3d& a : scene.tool().hull.vertices_T_m)
      least = std::min(least, half_space.normal_W.dot(X_WT * a) - half_space.offset_m);
  return least;
}

/// Transforms the half-spaces by the world motion a.
inline std::vector<HalfSpaceSettings> transformed(const Pose& a, std::vector<HalfSpaceSettings> half_spaces) {
  for (HalfSpaceSettings& h : half_spaces) {
    h.normal_W = a.rotation * h.normal_W;
    h.offset_m += h.normal_W.dot(a.translation_m);
  }
  return half_spaces;
}

}  // namespace wrenchd::test
