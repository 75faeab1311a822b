// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/convex_hull.hpp"

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

  ConvexBody body;
  for (const auto v : hull.vertices()) {
    const auto& p = hull.point(v);
    body.vertices_T_m.emplace_back(p.x(), p.y(), p.z());
    body.ring_begin.push_back(static_cast<std::uint32_t>(body.ring.size()));
    for (const auto neighbour : CGAL::vertices_around_target(v, hull)) body.ring.push_back(neighbour);
  }
  body.ring_begin.push_back(static_cast<std::uint32_t>(body.ring.size()));
  return body;
}

}  // namespace wrenchd
