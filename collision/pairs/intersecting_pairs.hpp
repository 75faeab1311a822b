// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <vector>

#include "collision/pairs/bvh_traversal.hpp"
#include "collision/scene.hpp"

namespace wrenchd {

/// All pairs of triangles of two meshes that meet at one pose, touching included.
///
/// A walk decides what single precision can decide for sure; of the few pairs that are left each is asked in
/// double precision (triangles_intersect()). All memory is taken at construction. One object serves one
/// thread.
class IntersectingPairs {
 public:
  explicit IntersectingPairs(
      simd::TraversalKernel kernel = nullptr);  ///< null: the fastest that this processor runs

  /// A at X_BA, B standing. False where there was no room for all that may meet; what was found is there.
  /// RT safe.
  bool find(const MeshBvh& a, const MeshBvh& b, const Pose& X_BA) noexcept;
  std::span<const TrianglePair> pairs() const noexcept { return pairs_; }
  /// Of the last search: how many pairs were asked in double precision.
  std::size_t double_precision_tests() const noexcept { return traversal_.size(); }

 private:
  BvhTraversal traversal_;
  std::vector<TrianglePair> pairs_;
};

}  // namespace wrenchd
