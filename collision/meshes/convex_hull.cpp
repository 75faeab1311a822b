// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/convex_hull.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <optional>
#include <vector>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/convex_hull_3.h>

#include "core/least_distance.hpp"

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

/// The neighbours of each vertex of a mesh. At the border of a surface some may be missing.
class Neighbours {
 public:
  explicit Neighbours(const TriangleMesh& mesh)
      : begin_(mesh.vertices_m.size() + 1, 0), vertices_(3 * mesh.triangles.size()) {
    for (const auto& corners : mesh.triangles)
      for (const std::uint32_t v : corners) ++begin_[v + 1];
    std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
    std::vector<std::uint32_t> at(begin_.begin(), begin_.end() - 1);
    for (const auto& [a, b, c] : mesh.triangles)
      vertices_[at[a]++] = b, vertices_[at[b]++] = c, vertices_[at[c]++] = a;
  }
  std::span<const std::uint32_t> of(std::size_t vertex) const {
    return std::span(vertices_).subspan(begin_[vertex], begin_[vertex + 1] - begin_[vertex]);
  }

 private:
  std::vector<std::uint32_t> begin_, vertices_;
};

/// Finds the vertices that a plane separates from their neighbours. A vertex of the hull is one of them.
class LocalExtremes {
 public:
  explicit LocalExtremes(const TriangleMesh& mesh) : mesh_(mesh), neighbours_(mesh) {}

  std::vector<Vector3d> find() {
    std::vector<Vector3d> found;
    for (std::size_t v = 0; v < mesh_.vertices_m.size(); ++v)
      if (is_extreme(v)) found.push_back(mesh_.vertices_m[v]);
    return found;
  }

 private:
  /// Returns true if a z exists with n . z >= kSlope for the unit vectors n from all neighbours to the
  /// vertex. The plane through the vertex with normal z then separates the vertex from its neighbours. If the
  /// shortest z is longer than kSlope / kRounding, the vertex counts as flat.
  bool is_extreme(std::size_t v) {
    const auto around = neighbours_.of(v);
    if (around.empty() || around.size() > kMaxNeighbours) return true;
    problem_.clear();
    for (const std::uint32_t neighbour : around) {
      const Vector3d edge = mesh_.vertices_m[v] - mesh_.vertices_m[neighbour];
      const double length = edge.norm();
      if (!(length > 0.0)) return true;
      problem_.add_unit(edge / length, kSlope);
    }
    switch (problem_.solve(Vector3d::Zero(), kSlope * kRounding)) {
      case decltype(problem_)::Status::optimal:
        return problem_.z().norm() * kRounding < kSlope;
      case decltype(problem_)::Status::infeasible:
        return false;
      case decltype(problem_)::Status::budget_spent:
        break;
    }
    return true;
  }

  static constexpr std::size_t kMaxNeighbours = 64;
  /// Height of a vertex above its neighbours, as a fraction of its edges, that rounding explains.
  static constexpr double kRounding = 1e-12;
  static constexpr double kSlope = 1e-6;  ///< scale of the problem; the result does not depend on it

  const TriangleMesh& mesh_;
  Neighbours neighbours_;
  LeastDistance<3, kMaxNeighbours> problem_;
};

}  // namespace

ConvexBody convex_hull(const TriangleMesh& mesh) {
  const std::vector<Vector3d> extremes = LocalExtremes(mesh).find();
  return convex_hull(extremes.size() >= 4 ? std::span(extremes) : std::span(mesh.vertices_m));
}

ConvexBody convex_hull(std::span<const Vector3d> points_T_m) {
  double size = 0.0;
  if (points_T_m.size() >= 3)
    if (const auto normal = plane_normal(points_T_m, size)) {
      std::vector<Vector3d> thick;
      for (const Vector3d& p : points_T_m)
        for (const double side : {-kSheet, kSheet}) thick.push_back(p + side * size * *normal);
      if (!plane_normal(thick, size)) return convex_hull(thick);
    }
  using HullKernel = CGAL::Exact_predicates_inexact_constructions_kernel;
  using SurfaceMesh = CGAL::Surface_mesh<HullKernel::Point_3>;
  std::vector<HullKernel::Point_3> points;
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
