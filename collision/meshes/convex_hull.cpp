// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/convex_hull.hpp"

#include <algorithm>
#include <cmath>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/convex_hull_3.h>

namespace wrenchd {

ConvexBody convex_hull(std::span<const Vector3d> points_T_m) {
  using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
  using SurfaceMesh = CGAL::Surface_mesh<Kernel::Point_3>;
  std::vector<Kernel::Point_3> points;
  points.reserve(points_T_m.size());
  for (const Vector3d& p : points_T_m) points.emplace_back(p.x(), p.y(), p.z());
  SurfaceMesh hull;
  CGAL::convex_hull_3(points.begin(), points.end(), hull);

  // CGAL orders vertices by memory addresses. Sorting by coordinates makes the body equal in every run.
  using Vertex = SurfaceMesh::Vertex_index;
  std::vector<Vertex> ordered(hull.vertices_begin(), hull.vertices_end());
  std::sort(ordered.begin(), ordered.end(),
            [&](Vertex x, Vertex y) { return hull.point(x) < hull.point(y); });
  std::vector<std::uint32_t> rank(ordered.size());
  for (std::uint32_t i = 0; i < ordered.size(); ++i) rank[ordered[i]] = i;

  ConvexBody body;
  for (const Vertex v : ordered) {
    const auto& p = hull.point(v);
    body.vertices_T_m.emplace_back(p.x(), p.y(), p.z());
    body.ring_begin.push_back(static_cast<std::uint32_t>(body.ring.size()));
    const auto begin = static_cast<std::ptrdiff_t>(body.ring.size());
    for (const Vertex neighbour : CGAL::vertices_around_target(v, hull)) body.ring.push_back(rank[neighbour]);
    std::rotate(body.ring.begin() + begin, std::min_element(body.ring.begin() + begin, body.ring.end()),
                body.ring.end());
  }
  body.ring_begin.push_back(static_cast<std::uint32_t>(body.ring.size()));
  body.compute_derived_data();
  return body;
}

/// Sums the tetrahedra from the first vertex to each triangle.
double volume(const ConvexBody& body) {
  double sixfold = 0.0;
  const Vector3d& o = body.vertices_T_m.front();
  for (std::uint32_t v = 0; v < body.vertices_T_m.size(); ++v) {
    const auto ring = body.ring_of(v);
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const std::uint32_t a = ring[i];
      const std::uint32_t b = ring[(i + 1) % ring.size()];
      if (v > a || v > b) continue;
      const auto edge = [&](std::uint32_t k) -> Vector3d { return body.vertices_T_m[k] - o; };
      sixfold += std::abs(edge(v).cross(edge(a)).dot(edge(b)));
    }
  }
  return sixfold / 6.0;
}

}  // namespace wrenchd
