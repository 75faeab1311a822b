// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/mesh_surface.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/least_distance.hpp"

namespace wrenchd {
namespace {

/// Triangles are coplanar if their corners lie within this distance of one plane: a fraction of the mesh's
/// size, and at most a tenth of the proxy's clearance [m].
constexpr double kCoplanar = 1e-10;
constexpr double kMaxCoplanar_m = 1e-10;
/// A vertex is convex only if its neighbours fall away by at least this angle [rad].
constexpr double kMinFallAngle_rad = 1e-7;

constexpr int next(int i) noexcept {
  return i == 2 ? 0 : i + 1;
}

/// Returns true if a direction n exists with n . e < 0 for all directions e. Searches the direction of
/// steepest descent with the least-distance problem  min |z|  s.t.  -e . z >= 1.  Rows are added a few at a
/// time, because a vertex may have any number of neighbours.
bool all_fall_away(const std::vector<Vector3d>& directions, const Vector3d& first_guess) {
  const auto worst_of = [&](const Vector3d& n) {
    return *std::max_element(directions.begin(), directions.end(),
                             [&](const Vector3d& a, const Vector3d& b) { return n.dot(a) < n.dot(b); });
  };
  if (first_guess.dot(worst_of(first_guess)) < -kMinFallAngle_rad) return true;
  constexpr std::size_t kRows = 32;
  LeastDistance<3, kRows> problem;
  Vector3d n = first_guess;
  for (std::size_t row = 0; row < kRows; ++row) {
    const Vector3d worst = worst_of(n);
    if (row > 0 && n.dot(worst) < -kMinFallAngle_rad) return true;
    problem.add_unit(-worst, 1.0);
    if (problem.solve(Vector3d::Zero(), 1e-12) != decltype(problem)::Status::optimal) return false;
    const double length = problem.z().norm();
    if (length * kMinFallAngle_rad > 1.0) return false;
    n = problem.z() / length;
  }
  return false;
}

}  // namespace

MeshSurface::MeshSurface(TriangleMesh mesh, Kind kind) : mesh_(std::move(mesh)), kind_(kind) {
  for (const Vector3d& p : mesh_.vertices_m) radius_m_ = std::max(radius_m_, p.norm());
  features_.assign(mesh_.triangles.size(), {{kNone, kNone, kNone}, {kNone, kNone, kNone}});
  find_neighbours();
  find_planes();
  find_convex_edges();
  find_convex_vertices();
}

/// Pairs a side from a to b with a side from b to a. Sides stay unpaired unless there is exactly one of each
/// direction.
void MeshSurface::find_neighbours() {
  struct TriangleHalfEdge {
    std::uint64_t key;  ///< both vertices, the smaller number first
    std::uint32_t triangle;
    std::uint8_t side;
    bool forward;
  };
  std::vector<TriangleHalfEdge> half_edges;
  half_edges.reserve(3 * mesh_.triangles.size());
  for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t)
    for (int i = 0; i < 3; ++i) {
      const std::uint64_t a = mesh_.triangles[t][static_cast<std::size_t>(i)];
      const std::uint64_t b = mesh_.triangles[t][static_cast<std::size_t>(next(i))];
      half_edges.push_back({std::min(a, b) << 32 | std::max(a, b), t, static_cast<std::uint8_t>(i), a < b});
    }
  std::sort(half_edges.begin(), half_edges.end(), [](const TriangleHalfEdge& a, const TriangleHalfEdge& b) {
    return std::pair(a.key, a.triangle) < std::pair(b.key, b.triangle);
  });
  neighbours_.assign(mesh_.triangles.size(), {kNone, kNone, kNone});
  for (std::size_t i = 0; i < half_edges.size();) {
    std::size_t end = i + 1;
    while (end < half_edges.size() && half_edges[end].key == half_edges[i].key) ++end;
    if (end - i == 2 && half_edges[i].forward != half_edges[i + 1].forward) {
      neighbours_[half_edges[i].triangle][half_edges[i].side] = half_edges[i + 1].triangle;
      neighbours_[half_edges[i + 1].triangle][half_edges[i + 1].side] = half_edges[i].triangle;
    }
    i = end;
  }
}

/// Grows flat regions from the largest remaining triangle. All triangles of a region take its plane.
void MeshSurface::find_planes() {
  const std::size_t count = mesh_.triangles.size();
  std::vector<Vector3d> area_normals(count);
  std::vector<double> area(count);
  for (std::uint32_t t = 0; t < count; ++t) {
    const Vector3d& a = corner_m(t, 0);
    area_normals[t] = (corner_m(t, 1) - a).cross(corner_m(t, 2) - a);
    area[t] = area_normals[t].norm();
  }
  std::vector<std::uint32_t> largest_first(count);
  std::iota(largest_first.begin(), largest_first.end(), 0U);
  std::stable_sort(largest_first.begin(), largest_first.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return area[a] > area[b]; });

  const double flat_m = std::min(kCoplanar * radius_m_, kMaxCoplanar_m);
  planes_.resize(count);
  planar_region_.assign(count, kNone);
  std::vector<std::uint32_t> front;
  for (const std::uint32_t seed : largest_first) {
    if (planar_region_[seed] != kNone) continue;
    const Vector3d normal = area_normals[seed].normalized();
    const Plane plane = {normal, normal.dot(corner_m(seed, 0))};
    const auto lies_in_plane = [&](std::uint32_t t) {
      for (int i = 0; i < 3; ++i)
        if (!(std::abs(normal.dot(corner_m(t, i)) - plane.offset_m) <= flat_m)) return false;
      return normal.dot(area_normals[t]) >= 0.0;
    };
    planar_region_[seed] = seed;
    front.assign(1, seed);
    while (!front.empty()) {
      const std::uint32_t t = front.back();
      front.pop_back();
      planes_[t] = plane;
      for (const std::uint32_t u : neighbours_[t]) {
        if (u == kNone || planar_region_[u] != kNone || !lies_in_plane(u)) continue;
        planar_region_[u] = seed;
        front.push_back(u);
      }
    }
  }
}

/// Returns true if the face across this side falls away: its far corner lies below the plane.
bool MeshSurface::is_convex_edge(std::uint32_t triangle, int side) const noexcept {
  const std::uint32_t other = neighbours_[triangle][static_cast<std::size_t>(side)];
  if (other == kNone) return true;
  if (planar_region_[other] == planar_region_[triangle]) return false;
  if (kind_ == Kind::surface) return true;
  const Plane& plane = planes_[triangle];
  double height_m = 0.0;
  for (int i = 0; i < 3; ++i) {
    const double h = plane.normal.dot(corner_m(other, i)) - plane.offset_m;
    if (std::abs(h) > std::abs(height_m)) height_m = h;
  }
  return height_m < 0.0;
}

void MeshSurface::find_convex_edges() {
  for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t)
    for (int i = 0; i < 3; ++i) {
      const auto side = static_cast<std::size_t>(i);
      const std::uint32_t other = neighbours_[t][side];
      if (other < t || !is_convex_edge(t, i)) continue;  // the triangle with the smaller number owns the edge
      features_[t].edges[side] = static_cast<std::uint32_t>(convex_edges_.size());
      const Corners& corners = mesh_.triangles[t];
      convex_edges_.push_back({{corners[side], corners[static_cast<std::size_t>(next(i))]}, {t, other}});
    }
}

/// At a convex vertex at least three convex edges meet: the edges of the cone that its neighbours span.
void MeshSurface::find_convex_vertices() {
  const std::size_t count = mesh_.vertices_m.size();
  std::vector<std::uint32_t> sharp_edges(count, 0);
  for (const Edge& edge : convex_edges_)
    for (const std::uint32_t v : edge.vertices) ++sharp_edges[v];

  // Lists the triangles at each vertex, one list after the other.
  std::vector<std::uint32_t> begin(count + 1, 0), at(3 * mesh_.triangles.size());
  for (const Corners& corners : mesh_.triangles)
    for (const std::uint32_t v : corners) ++begin[v + 1];
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<std::uint32_t> fill(begin.begin(), begin.end() - 1);
  for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t)
    for (const std::uint32_t v : mesh_.triangles[t]) at[fill[v]++] = t;

  ring_begin_.assign(count + 1, 0);
  std::vector<std::uint32_t> neighbours;
  std::vector<Vector3d> directions;
  for (std::uint32_t v = 0; v < count; ++v) {
    ring_begin_[v + 1] = ring_begin_[v];
    if (begin[v] == begin[v + 1] || (kind_ == Kind::solid && sharp_edges[v] < 3)) continue;
    if (sharp_edges[v] == 0) continue;
    neighbours.clear();
    Vector3d mean_normal = Vector3d::Zero();
    for (std::uint32_t k = begin[v]; k < begin[v + 1]; ++k) {
      mean_normal += planes_[at[k]].normal;
      for (const std::uint32_t corner : mesh_.triangles[at[k]])
        if (corner != v) neighbours.push_back(corner);
    }
    std::sort(neighbours.begin(), neighbours.end());
    neighbours.erase(std::unique(neighbours.begin(), neighbours.end()), neighbours.end());
    directions.clear();
    for (const std::uint32_t n : neighbours)
      directions.push_back((mesh_.vertices_m[n] - mesh_.vertices_m[v]).normalized());
    if (kind_ == Kind::solid && !all_fall_away(directions, mean_normal.normalized())) continue;
    const std::uint32_t owner = at[begin[v]];
    for (std::size_t i = 0; i < 3; ++i)
      if (mesh_.triangles[owner][i] == v) features_[owner].vertices[i] = v;
    ring_.insert(ring_.end(), neighbours.begin(), neighbours.end());
    ring_begin_[v + 1] = static_cast<std::uint32_t>(ring_.size());
  }
}

}  // namespace wrenchd
