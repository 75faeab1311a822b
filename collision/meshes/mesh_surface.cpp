// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/mesh_surface.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>
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
/// Two faces of a surface whose wedge is narrower than this angle [rad] lie on each other. Their edge then
/// acts as a border.
constexpr double kMinWedge = 1e-3;

constexpr int next_corner(int i) noexcept {
  return i == 2 ? 0 : i + 1;
}

/// Returns a direction n with n . e < 0 for all directions e, if there is one. Searches the direction of
/// steepest descent with the least-distance problem  min |z|  s.t.  -e . z >= 1.  Rows are added a few at a
/// time, because a vertex may have any number of neighbours.
std::optional<Vector3d> direction_above(const std::vector<Vector3d>& directions,
                                        const Vector3d& first_guess) {
  const auto worst_of = [&](const Vector3d& n) {
    return *std::max_element(directions.begin(), directions.end(),
                             [&](const Vector3d& a, const Vector3d& b) { return n.dot(a) < n.dot(b); });
  };
  if (first_guess.dot(worst_of(first_guess)) < -kMinFallAngle_rad) return first_guess;
  constexpr std::size_t kRows = 32;
  LeastDistance<3, kRows> problem;
  Vector3d n = first_guess;
  for (std::size_t row = 0; row < kRows; ++row) {
    const Vector3d worst = worst_of(n);
    if (row > 0 && n.dot(worst) < -kMinFallAngle_rad) return n;
    problem.add_unit(-worst, 1.0);
    if (problem.solve(Vector3d::Zero(), 1e-12) != decltype(problem)::Status::optimal) return {};
    const double length = problem.z().norm();
    if (length * kMinFallAngle_rad > 1.0) return {};
    n = problem.z() / length;
  }
  return {};
}

}  // namespace

MeshSurface::MeshSurface(TriangleMesh mesh, Kind kind) : mesh_(std::move(mesh)), kind_(kind) {
  for (const Vector3d& p : mesh_.vertices_m) radius_m_ = std::max(radius_m_, p.norm());
  features_.assign(mesh_.triangles.size(), {{kNone, kNone, kNone}, {kNone, kNone, kNone}});
  const std::vector<CrowdedEdge> crowded = find_neighbours();
  is_closed_ = kind_ == Kind::surface && find_closed(crowded);
  find_planes();
  find_convex_edges(crowded);
  find_convex_vertices();
}

/// Pairs the two sides at each edge. In a solid one goes from a to b and the other from b to a; the two faces
/// of a surface may be wound against each other. All other sides stay unpaired. Returns the edges of three or
/// more faces of a surface.
std::vector<MeshSurface::CrowdedEdge> MeshSurface::find_neighbours() {
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
      const std::uint64_t b = mesh_.triangles[t][static_cast<std::size_t>(next_corner(i))];
      half_edges.push_back({std::min(a, b) << 32 | std::max(a, b), t, static_cast<std::uint8_t>(i), a < b});
    }
  std::sort(half_edges.begin(), half_edges.end(), [](const TriangleHalfEdge& a, const TriangleHalfEdge& b) {
    return std::pair(a.key, a.triangle) < std::pair(b.key, b.triangle);
  });
  neighbours_.assign(mesh_.triangles.size(), {kNone, kNone, kNone});
  std::vector<CrowdedEdge> crowded;
  for (std::size_t i = 0; i < half_edges.size();) {
    std::size_t end = i + 1;
    while (end < half_edges.size() && half_edges[end].key == half_edges[i].key) ++end;
    if (end - i == 2 && (kind_ == Kind::surface || half_edges[i].forward != half_edges[i + 1].forward)) {
      neighbours_[half_edges[i].triangle][half_edges[i].side] = half_edges[i + 1].triangle;
      neighbours_[half_edges[i + 1].triangle][half_edges[i + 1].side] = half_edges[i].triangle;
    }
    if (end - i > 2 && kind_ == Kind::surface) {
      crowded.emplace_back();
      for (std::size_t k = i; k < end; ++k)
        crowded.back().push_back({half_edges[k].triangle, half_edges[k].side});
    }
    i = end;
  }
  return crowded;
}

/// Returns true if every side has a neighbour that is wound alike, and all triangles are reached from the
/// first one.
bool MeshSurface::find_closed(const std::vector<CrowdedEdge>& crowded) const {
  if (!crowded.empty() || mesh_.triangles.empty()) return false;
  std::vector<bool> reached(mesh_.triangles.size(), false);
  std::vector<std::uint32_t> front = {0};
  reached[0] = true;
  std::size_t count = 0;
  while (!front.empty()) {
    const std::uint32_t t = front.back();
    front.pop_back();
    ++count;
    for (std::uint8_t i = 0; i < 3; ++i) {
      const std::uint32_t other = neighbours_[t][i];
      if (other == kNone || !is_wound_alike({t, i}, other)) return false;
      if (reached[other]) continue;
      reached[other] = true;
      front.push_back(other);
    }
  }
  return count == mesh_.triangles.size();
}

double MeshSurface::angle_at(std::uint32_t triangle, std::uint32_t vertex) const noexcept {
  int i = 0;
  while (i < 2 && mesh_.triangles[triangle][static_cast<std::size_t>(i)] != vertex) ++i;
  const Vector3d& p = corner_m(triangle, i);
  const Vector3d to = corner_m(triangle, next_corner(i)) - p,
                 back = corner_m(triangle, next_corner(next_corner(i))) - p;
  return std::atan2(to.cross(back).norm(), to.dot(back));
}

bool MeshSurface::is_wound_alike(std::uint32_t triangle, std::size_t side,
                                 std::uint32_t other) const noexcept {
  const Corners& corners = mesh_.triangles[triangle];
  const std::uint32_t from = corners[side], to = corners[side == 2 ? 0 : side + 1];
  for (int k = 0; k < 3; ++k)
    if (mesh_.triangles[other][static_cast<std::size_t>(k)] == from)
      return mesh_.triangles[other][static_cast<std::size_t>(next_corner(k))] != to;
  return true;
}

/// Grows flat regions from the largest remaining triangle. All triangles of a region take its plane. A
/// triangle that is wound against the first one takes the plane with the opposite normal.
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
  std::vector<bool> reversed(count, false);  // wound against the first triangle of its region
  for (const std::uint32_t seed : largest_first) {
    if (planar_region_[seed] != kNone) continue;
    const Vector3d normal = area_normals[seed].normalized();
    const Plane plane = {normal, normal.dot(corner_m(seed, 0))};
    const auto lies_in_plane = [&](std::uint32_t t, bool turned) {
      for (int i = 0; i < 3; ++i)
        if (!(std::abs(normal.dot(corner_m(t, i)) - plane.offset_m) <= flat_m)) return false;
      return turned ? normal.dot(area_normals[t]) <= 0.0 : normal.dot(area_normals[t]) >= 0.0;
    };
    planar_region_[seed] = seed;
    front.assign(1, seed);
    while (!front.empty()) {
      const std::uint32_t t = front.back();
      front.pop_back();
      planes_[t] = reversed[t] ? Plane{-plane.normal, -plane.offset_m} : plane;
      for (std::uint8_t i = 0; i < 3; ++i) {
        const std::uint32_t u = neighbours_[t][i];
        if (u == kNone || planar_region_[u] != kNone) continue;
        const bool turned = reversed[t] == is_wound_alike({t, i}, u) && kind_ == Kind::surface;
        if (!lies_in_plane(u, turned)) continue;
        reversed[u] = turned;
        planar_region_[u] = seed;
        front.push_back(u);
      }
    }
  }
}

/// Returns the height of the corner of the face across a side that is farthest from the plane of the triangle
/// [m]. Negative: the face falls away.
double MeshSurface::height_beyond_m(TriangleSide side, std::uint32_t other) const noexcept {
  const Plane& plane = planes_[side.triangle];
  double height_m = 0.0;
  for (int i = 0; i < 3; ++i) {
    const double h = plane.normal.dot(corner_m(other, i)) - plane.offset_m;
    if (std::abs(h) > std::abs(height_m)) height_m = h;
  }
  return height_m;
}

void MeshSurface::add_edge(TriangleSide side, std::uint32_t other, std::array<std::int32_t, 2> sides) {
  const Corners& corners = mesh_.triangles[side.triangle];
  features_[side.triangle].edges[side.side] = static_cast<std::uint32_t>(convex_edges_.size());
  convex_edges_.push_back({{corners[side.side], corners[static_cast<std::size_t>(next_corner(side.side))]},
                           {side.triangle, other},
                           sides});
}

/// Adds the edge between two faces of a surface that do not lie in one plane. It is convex seen from the side
/// on which the other face falls away.
void MeshSurface::add_edge_of_surface(TriangleSide side, std::uint32_t other) {
  const std::int32_t from = height_beyond_m(side, other) < 0.0 ? 1 : -1;
  const std::array<std::int32_t, 2> sides = {from, is_wound_alike(side, other) ? from : -from};
  const Vector3d out = sides[0] * planes_[side.triangle].normal + sides[1] * planes_[other].normal;
  const bool folded = out.norm() < kMinWedge;
  add_edge(side, folded ? kNone : other, sides);
}

/// Adds an edge of three or more faces if one of the sectors between them is wider than 180 degrees. The
/// faces beside this sector are those that a tool in it meets.
void MeshSurface::add_crowded_edge(const CrowdedEdge& faces) {
  const Corners& corners = mesh_.triangles[faces[0].triangle];
  const Vector3d& origin = mesh_.vertices_m[corners[faces[0].side]];
  const Vector3d along =
      (mesh_.vertices_m[corners[static_cast<std::size_t>(next_corner(faces[0].side))]] - origin).normalized();
  /// A face as a half-line in the plane perpendicular to the edge.
  struct Ray {
    double angle;
    Vector3d direction;
    TriangleSide face;
  };
  std::vector<Ray> rays;
  Vector3d x = Vector3d::Zero(), y = Vector3d::Zero();
  for (const TriangleSide& face : faces) {
    const Vector3d apex = corner_m(face.triangle, next_corner(next_corner(face.side))) - origin;
    const Vector3d direction = (apex - along.dot(apex) * along).normalized();
    if (rays.empty()) x = direction, y = along.cross(direction);
    rays.push_back({std::atan2(y.dot(direction), x.dot(direction)), direction, face});
  }
  std::stable_sort(rays.begin(), rays.end(), [](const Ray& a, const Ray& b) { return a.angle < b.angle; });
  std::size_t widest = 0;
  double sector = 0.0;
  for (std::size_t k = 0; k < rays.size(); ++k) {
    const double to_next = k + 1 < rays.size() ? rays[k + 1].angle - rays[k].angle
                                               : rays[0].angle + 2.0 * std::numbers::pi - rays[k].angle;
    if (to_next > sector) sector = to_next, widest = k;
  }
  if (sector < std::numbers::pi + kMinFallAngle_rad) return;
  const Ray *first = &rays[widest], *second = &rays[(widest + 1) % rays.size()];
  if (second->face.triangle < first->face.triangle) std::swap(first, second);
  const auto side_of = [&](const Ray& ray, const Ray& other) -> std::int32_t {
    return planes_[ray.face.triangle].normal.dot(other.direction) < 0.0 ? 1 : -1;
  };
  const bool folded = sector > 2.0 * std::numbers::pi - kMinWedge;
  add_edge(first->face, folded ? kNone : second->face.triangle,
           {side_of(*first, *second), side_of(*second, *first)});
}

/// The triangle with the smaller number owns the edge between two.
void MeshSurface::find_convex_edges(const std::vector<CrowdedEdge>& crowded) {
  std::vector<bool> is_crowded(crowded.empty() ? 0 : 3 * mesh_.triangles.size(), false);
  for (const CrowdedEdge& faces : crowded)
    for (const TriangleSide& face : faces) is_crowded[std::size_t{3} * face.triangle + face.side] = true;
  for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t)
    for (std::uint8_t i = 0; i < 3; ++i) {
      const std::uint32_t other = neighbours_[t][i];
      if (other == kNone) {
        if (crowded.empty() || !is_crowded[std::size_t{3} * t + i]) add_edge({t, i}, kNone, {1, 1});
        continue;
      }
      if (other < t || planar_region_[other] == planar_region_[t]) continue;
      if (kind_ == Kind::surface)
        add_edge_of_surface({t, i}, other);
      else if (height_beyond_m({t, i}, other) < 0.0)
        add_edge({t, i}, other, {1, 1});
    }
  for (const CrowdedEdge& faces : crowded) add_crowded_edge(faces);
}

/// At a convex vertex at least three convex edges meet: the edges of the cone that its neighbours span. At
/// the border of a surface the cone may be flat and have two.
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

  const std::uint32_t least_edges = kind_ == Kind::solid ? 3 : 2;
  if (is_closed_) vertex_sides_.assign(count, 0);
  ring_begin_.assign(count + 1, 0);
  std::vector<std::uint32_t> neighbours;
  std::vector<Vector3d> directions;
  for (std::uint32_t v = 0; v < count; ++v) {
    ring_begin_[v + 1] = ring_begin_[v];
    if (begin[v] == begin[v + 1] || sharp_edges[v] < least_edges) continue;
    neighbours.clear();
    Vector3d mean_normal = Vector3d::Zero(), back = Vector3d::Zero();
    Vector3d weighted_normal = Vector3d::Zero();  // weights: the angles of the faces at the vertex
    for (std::uint32_t k = begin[v]; k < begin[v + 1]; ++k) {
      mean_normal += planes_[at[k]].normal;
      if (is_closed_) weighted_normal += angle_at(at[k], v) * planes_[at[k]].normal;
      for (const std::uint32_t corner : mesh_.triangles[at[k]])
        if (corner != v) neighbours.push_back(corner);
    }
    std::sort(neighbours.begin(), neighbours.end());
    neighbours.erase(std::unique(neighbours.begin(), neighbours.end()), neighbours.end());
    directions.clear();
    for (const std::uint32_t n : neighbours) {
      directions.push_back((mesh_.vertices_m[n] - mesh_.vertices_m[v]).normalized());
      back -= directions.back();
    }
    const Vector3d& first_guess = kind_ == Kind::solid ? mean_normal : back;
    const std::optional<Vector3d> above = direction_above(directions, first_guess.normalized());
    if (!above) continue;
    // The vertex is the point of its faces that is nearest to all points above it: core/METHOD.md,
    // section 14.10.
    if (is_closed_)
      vertex_sides_[v] = static_cast<std::uint8_t>(above->dot(weighted_normal) > 0.0 ? kFront : kBack);
    const std::uint32_t owner = at[begin[v]];
    for (std::size_t i = 0; i < 3; ++i)
      if (mesh_.triangles[owner][i] == v) features_[owner].vertices[i] = v;
    ring_.insert(ring_.end(), neighbours.begin(), neighbours.end());
    ring_begin_[v + 1] = static_cast<std::uint32_t>(ring_.size());
  }
}

}  // namespace wrenchd
