// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <limits>
#include <vector>

#include "collision/scene.hpp"

namespace wrenchd::test {

/// Returns the largest separation of two convex bodies over all relevant axes (face normals of both, cross
/// products of all edges) [m]. Tests every vertex for each axis. Exact if the bodies overlap; otherwise
/// positive and at most their distance. Slow. Shares only the vertices with the code under test.
inline double separation_m(const std::vector<Vector3d>& a_W, const ConvexBody& a, const ConvexBody& b) {
  double best = -std::numeric_limits<double>::infinity();
  const auto try_axis = [&](Vector3d n) {
    if (n.norm() < 1e-12) return;
    n.normalize();
    for (const double sign : {1.0, -1.0}) {
      double low = std::numeric_limits<double>::infinity();
      double high = -low;
      for (const Vector3d& p : a_W) low = std::min(low, sign * n.dot(p));
      for (const Vector3d& p : b.vertices_T_m) high = std::max(high, sign * n.dot(p));
      best = std::max(best, low - high);
    }
  };
  const auto edges_of = [](const ConvexBody& body, const std::vector<Vector3d>& points) {
    std::vector<Vector3d> edges;
    for (std::uint32_t v = 0; v < points.size(); ++v)
      for (const std::uint32_t w : body.ring_of(v))
        if (v < w) edges.push_back((points[w] - points[v]).normalized());
    return edges;
  };
  const auto try_faces = [&](const ConvexBody& body, const std::vector<Vector3d>& points) {
    for (std::uint32_t v = 0; v < points.size(); ++v) {
      const auto ring = body.ring_of(v);
      for (std::size_t i = 0; i < ring.size(); ++i)
        try_axis((points[ring[i]] - points[v]).cross(points[ring[(i + 1) % ring.size()]] - points[v]));
    }
  };
  try_faces(a, a_W);
  try_faces(b, b.vertices_T_m);
  const std::vector<Vector3d> edges_b = edges_of(b, b.vertices_T_m);
  for (const Vector3d& e : edges_of(a, a_W))
    for (const Vector3d& f : edges_b) try_axis(e.cross(f));
  return best;
}

/// Returns the separation of the scene's tool from its nearest obstacle [m].
inline double separation_m(const Scene& scene, const Pose& X_WT) {
  const ConvexBody& tool = scene.tool().hull;
  std::vector<Vector3d> points;
  for (const Vector3d& p : tool.vertices_T_m) points.push_back(X_WT * p);
  double least = std::numeric_limits<double>::infinity();
  for (const ConvexObstacle& obstacle : scene.convex())
    least = std::min(least, separation_m(points, tool, obstacle.body));
  for (const HalfSpaceSettings& half_space : scene.half_spaces())
    for (const Vector3d& p : points)
      least = std::min(least, half_space.normal_W.dot(p) - half_space.offset_m);
  return least;
}

}  // namespace wrenchd::test
