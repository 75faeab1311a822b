// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/surface_sector.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace wrenchd {
namespace {

/// Slope by which a face beside another one rises at least.
constexpr double kSlope = 1e-3;
/// Faces around a vertex that are tested. At a vertex with more of them, each side counts.
constexpr int kMaxStar = 64;
constexpr std::array kCorners = {0, 1, 2};

/// Squared distance of x from a triangle with the corner `apex`, as if its other side were far away.
double distance2_from_corner(const Vector3d& x, const Vector3d& apex, const Vector3d& a, const Vector3d& b,
                             const Vector3d& normal) noexcept {
  const Vector3d u = a - apex, w = b - apex, d = x - apex;
  if (u.cross(d).dot(normal) >= 0.0 && d.cross(w).dot(normal) >= 0.0) {
    const double height = normal.dot(d);
    return height * height;
  }
  const auto from_ray = [&](const Vector3d& along) {
    return (d - std::max(d.dot(along) / along.squaredNorm(), 0.0) * along).squaredNorm();
  };
  return std::min(from_ray(u), from_ray(w));
}

/// Position of a vertex among the corners of a triangle.
int corner_of(const MeshSurface& surface, std::uint32_t triangle, std::uint32_t vertex) noexcept {
  const auto& corners = surface.triangles()[triangle];
  return corners[0] == vertex ? 0 : corners[1] == vertex ? 1 : 2;
}

/// Returns true if x, near the vertex at the end of the edge, lies on the side of the faces around the vertex
/// from which the edge is convex. The nearest face decides; of faces equally near, the one that faces x most.
bool is_in_sector(const MeshSurface& surface, const MeshSurface::Edge& edge, std::uint32_t vertex,
                  const Vector3d& x) noexcept {
  const Vector3d& apex = surface.vertices_m()[vertex];
  double nearest2 = std::numeric_limits<double>::infinity(), height = 0.0;
  std::uint32_t triangle = edge.triangles[0], from = edge.triangles[1];
  double side = edge.sides[0];
  for (int i = 0; i < kMaxStar; ++i) {
    const int k = corner_of(surface, triangle, vertex);
    const auto next = static_cast<std::size_t>(k), previous = static_cast<std::size_t>(k == 0 ? 2 : k - 1);
    const Vector3d& normal = surface.planes()[triangle].normal;
    const double distance2 = distance2_from_corner(x, apex, surface.corner_m(triangle, (k + 1) % 3),
                                                   surface.corner_m(triangle, (k + 2) % 3), normal);
    const double h = side * normal.dot(x - apex);
    const bool ties = std::abs(distance2 - nearest2) <= 1e-6 * distance2;
    if (ties ? std::abs(h) > std::abs(height) : distance2 < nearest2) height = h;
    nearest2 = std::min(nearest2, distance2);
    const std::uint32_t across = surface.neighbour(triangle, next),
                        back = surface.neighbour(triangle, previous);
    const std::uint32_t on = across == from ? back : across;
    if (on == MeshSurface::kNone) return true;  // at a border there are no two sides
    if (on == edge.triangles[0]) return height > 0.0;
    if (!surface.is_wound_alike(triangle, on == across ? next : previous, on)) side = -side;
    from = triangle;
    triangle = on;
  }
  return true;
}

}  // namespace

bool is_behind_rim(const MeshSurface& surface, std::uint32_t triangle, const MeshSurface::Plane& side,
                   const Vector3d& p, const Vector3d& p_start) noexcept {
  const Vector3d& normal = surface.planes()[triangle].normal;
  for (int i = 0; i < 3; ++i) {
    const std::uint32_t beside = surface.neighbour(triangle, static_cast<std::size_t>(i));
    if (beside == MeshSurface::kNone || surface.planar_region(beside) == surface.planar_region(triangle))
      continue;
    const Vector3d& a = surface.corner_m(triangle, i);
    const Vector3d along = surface.corner_m(triangle, i == 2 ? 0 : i + 1) - a;
    if (normal.cross(along).dot(p - a) >= 0.0) continue;
    const bool rises = std::any_of(kCorners.begin(), kCorners.end(), [&](int k) {
      const Vector3d from_border = surface.corner_m(beside, k) - a;
      return side.normal.dot(from_border) > kSlope * from_border.norm();
    });
    // A tool in the valley between the two faces is on that side of the face beside where this face is.
    const Vector3d& across = surface.planes()[beside].normal;
    const double front = across.dot(surface.corner_m(triangle, i == 0 ? 2 : i - 1) - a);
    if (rises && front * across.dot(p_start - a) <= 0.0) return true;
  }
  return false;
}

bool is_behind_end(const MeshSurface& surface, const MeshSurface::Edge& edge, const Vector3d& p,
                   const Vector3d& x, const Vector3d& x_start) noexcept {
  if (edge.is_border()) return false;
  for (std::size_t i = 0; i < 2; ++i) {
    const Vector3d &end = surface.vertices_m()[edge.vertices[i]],
                   &other = surface.vertices_m()[edge.vertices[1 - i]];
    if ((p - end).dot(other - end) < 0.0)
      return !is_in_sector(surface, edge, edge.vertices[i], x) &&
             !is_in_sector(surface, edge, edge.vertices[i], x_start);
  }
  return false;
}

}  // namespace wrenchd
