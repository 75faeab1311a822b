// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/convex_hull.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/convex_hull_3.h>

namespace wrenchd {

namespace {

/// A flat sheet receives this thickness on each side, as a fraction of its size.
constexpr double kSheet = 1e-6;
/// Points this close to one plane, as a fraction of their size, count as flat.
constexpr double kFlat = 1e-9;

/// Returns the unit normal of the plane in which all points lie; nothing if they span a volume. size:
/// receives the largest distance of a point from the first one.
std::optional<Vector3d> plane_normal(std::span<const Vector3d> points, double& size) {
  const auto farthest = [&](const auto& measure) {
    return *std::max_element(points.begin(), points.end(),
                             [&](const Vector3d& a, const Vector3d& b) { return measure(a) < measure(b); });
  };
  const Vector3d& a = points.front();
  const Vector3d b = farthest([&](const Vector3d& p) { return (p - a).norm(); }) - a;
  size = b.norm();
  const Vector3d c = farthest([&](const Vector3d& p) { return (p - a).cross(b).norm(); }) - a;
  const Vector3d normal = b.cross(c).normalized();
  const Vector3d d = farthest([&](const Vector3d& p) { return std::abs((p - a).dot(normal)); }) - a;
  if (std::abs(d.dot(normal)) > kFlat * size) return {};
  return normal;
}

}  // namespace

ConvexBody convex_hull(std::span<const Vector3d> points_T_m) {
  double size = 0.0;
  if (points_T_m.size() >= 3)
    if (const auto normal = plane_normal(points_T_m, size)) {
      std::vector<Vector3d> thick;
      for (const Vector3d& p : points_T_m)
        for (const double side : {-kSheet, kSheet}) thick.push_back(p + side * size * *normal);
      if (!plane_normal(thick, size)) return convex_hull(thick);
    }
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

TriangleMesh hull_surface(const ConvexBody& body) {
  TriangleMesh mesh{body.vertices_T_m, {}};
  Vector3d middle = Vector3d::Zero();
  for (const Vector3d& p : body.vertices_T_m) middle += p / static_cast<double>(body.vertices_T_m.size());
  for (std::uint32_t v = 0; v < body.vertices_T_m.size(); ++v) {
    const auto ring = body.ring_of(v);
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const std::uint32_t a = ring[i], b = ring[(i + 1) % ring.size()];
      if (v > a || v > b) continue;
      const Vector3d& p = body.vertices_T_m[v];
      const Vector3d normal = (body.vertices_T_m[a] - p).cross(body.vertices_T_m[b] - p);
      mesh.triangles.push_back(normal.dot(p - middle) < 0.0 ? std::array{v, b, a} : std::array{v, a, b});
    }
  }
  return mesh;
}

}  // namespace wrenchd
