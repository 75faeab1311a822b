// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/pairs/intersecting_pairs.hpp"

#include <limits>

#include "collision/pairs/triangle_intersection.hpp"
#include "core/frame.hpp"

namespace wrenchd {
namespace {

Triangle triangle(const MeshSurface& surface, std::uint32_t t) noexcept {
  return {surface.corner_m(t, 0), surface.corner_m(t, 1), surface.corner_m(t, 2)};
}

}  // namespace

IntersectingPairs::IntersectingPairs(simd::TraversalKernel kernel) : traversal_(kernel) {
  pairs_.reserve(BvhTraversal::kCapacity);
}

bool IntersectingPairs::find(const MeshBvh& a, const MeshBvh& b, const Pose& X_BA) noexcept {
  VisitBudget unlimited = {std::numeric_limits<std::uint32_t>::max()};
  Sweep sweep = {X_BA, X_BA};
  sweep.classify = true;
  const bool complete = traversal_.find(a.bvh, b.bvh, sweep, unlimited);
  const std::span<const TrianglePair> certain = traversal_.intersecting();
  pairs_.assign(certain.begin(), certain.end());
  const Frame X(X_BA);
  for (const TrianglePair& pair : traversal_) {
    Triangle moved = triangle(a.surface, pair.a);
    for (Vector3d& corner : moved) corner = X * corner;
    if (triangles_intersect(moved, triangle(b.surface, pair.b))) pairs_.push_back(pair);
  }
  return complete;
}

}  // namespace wrenchd
