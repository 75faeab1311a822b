// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <vector>

#include "collision/pairs/bvh_traversal.hpp"
#include "collision/scene.hpp"

namespace wrenchd {

/// Finds all pairs of triangles of two meshes that intersect at one pose, touching pairs included.
///
/// The BVH traversal classifies pairs in single precision. Pairs in doubt are tested in double precision
/// (triangles_intersect()). The constructor allocates all memory. One object serves one thread.
class IntersectingPairs {
 public:
  explicit IntersectingPairs(
      simd::TraversalKernel kernel = nullptr);  ///< null: selects the fastest kernel for this processor

  /// Searches the pairs with A at X_BA in the frame of B. Returns false if the room for pairs was too small;
  /// pairs() then holds the pairs found so far. Not RT-safe: allocates nothing, but its work is unbounded.
  bool find(const MeshBvh& a, const MeshBvh& b, const Pose& X_BA) noexcept;
  std::span<const TrianglePair> pairs() const noexcept { return pairs_; }
  /// Returns the number of pairs that the last search tested in double precision.
  std::size_t double_precision_tests() const noexcept { return traversal_.size(); }

 private:
  BvhTraversal traversal_;
  std::vector<TrianglePair> pairs_;
};

}  // namespace wrenchd
