// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "collision/meshes/triangle_bvh.hpp"
#include "collision/pairs/single_precision.hpp"
#include "core/pose.hpp"

namespace wrenchd {

/// A triangle of mesh A and a triangle of mesh B.
struct TrianglePair {
  std::uint32_t a, b;

  friend bool operator==(const TrianglePair&, const TrianglePair&) = default;
};

/// A motion of A in the frame of B from one pose to another.
struct Sweep {
  Pose X_BA_start, X_BA_end;
  /// The traversal finds the pairs for all poses within reach_m of the path. The distance of two poses is
  /// |translation| + angle * radius of A [m].
  double reach_m = 0.0;
  /// False: list only pairs whose features can meet first, a convex vertex in one triangle or a convex edge
  /// in each.
  bool all_pairs = true;
  /// True: classify pairs as intersecting, separate or in doubt. Precondition: a single pose, reach_m = 0,
  /// all_pairs.
  bool classify = false;
  /// Sides of B's surface from which A can meet it (MeshSurface::kFront, kBack). Features that are convex
  /// from the other side only are omitted, unless all_pairs.
  unsigned sides_b = MeshSurface::kBothSides;
};

/// Work limit of traversals. The limit counts work, not time, so that a replay gives equal results.
struct VisitBudget {
  std::uint32_t remaining = 0;  ///< node and leaf visits left
  std::uint32_t reserved = 0;   ///< part of `remaining` that deferrable work must not use
};

namespace simd {

/// Input of the kernels, as plain arrays (single_precision.hpp).
struct RelativeMotion {
  Transform X_BA_middle, X_AB_middle;  ///< pose half way along the path
  Transform X_BA_start, X_BA_end;
  Transform displacement_BA,
      displacement_AB;  ///< R p + t is the displacement of a point p of A, in B
  float half_angle;     ///< half the rotation angle of the path [rad]
  float margin;         ///< all boxes grow by this amount [m]
  /// A plane of A may approach a point by reach * max(1, distance of the point / radius) in addition [m]. The
  /// arc deviation is included.
  float reach, radius;
  float rounding;
  float centre_B[3];    ///< origin of A at the end of the path, in B [m]
  float centre_travel;  ///< travel of the origin of A [m]
  bool moving;
  bool all_pairs;
  bool classify;
  unsigned sides_b;
};
struct BvhArrays {
  const TriangleBvh::Box* boxes;
  const TriangleBvh::Node* nodes;
  const TriangleBvh::Leaf* leaves;
};
/// The state of a traversal. The traversal can be interrupted after every node visit.
struct TraversalJob {
  BvhArrays a, b;
  RelativeMotion motion;
  TrianglePair* pairs;  ///< room for pairs: listed pairs from the front, intersecting pairs from the back
  std::uint32_t capacity;
  std::uint32_t* stack;  ///< room for kStack pairs of box numbers
  void* moved_leaves;    ///< room for kMovedLeavesBytes, aligned to 64 bytes
  std::uint32_t max_node_visits = 0;
  // Progress:
  std::uint32_t node_visits = 0, pair_count = 0, intersecting_count = 0, stack_top = 0;
  bool started = false;
  bool overflow = false;  ///< true if the room for pairs or the stack is exhausted
};
constexpr std::size_t kStack = 8192;
constexpr std::size_t kMovedLeavesBytes = std::size_t{1} << 17;

/// Continues until the stack is empty, the room is exhausted or max_node_visits is reached. RT-safe.
using TraversalKernel = void (*)(TraversalJob&) noexcept;
void traverse_portable(TraversalJob& job) noexcept;
void traverse_avx2(TraversalJob& job) noexcept;
/// Returns true if the processor supports traverse_avx2(). RT-safe.
bool has_avx2() noexcept;

}  // namespace simd

/// Traverses two BVHs together and lists the pairs of triangles that may meet.
///
/// The list contains every pair that touches on the path (points of A move straight from start to end) or at
/// a pose within reach of it. It omits the pairs that the plane of one of the two triangles separates on the
/// whole path, and most other separate pairs. The caller tests the listed pairs in double precision. The
/// processor decides which separate pairs remain in the list. It does not affect the pairs that meet.
///
/// The constructor allocates all memory. One object serves one thread. All members but the constructor are
/// RT-safe.
class BvhTraversal {
 public:
  static constexpr std::size_t kCapacity = std::size_t{1} << 16;

  explicit BvhTraversal(
      simd::TraversalKernel kernel = nullptr);  ///< null: selects the fastest kernel for this processor

  /// Runs a complete traversal. Returns false if the room for pairs or the budget is too small; the list then
  /// holds the pairs found so far. Reduces the budget by the work done. RT-safe.
  bool find(const TriangleBvh& a, const TriangleBvh& b, const Sweep& sweep, VisitBudget& budget) noexcept {
    start(a, b, sweep);
    return resume(budget) && complete();
  }

  /// The same traversal in parts: start() prepares it, resume() continues until it has ended (returns true)
  /// or the budget is spent (returns false). Both BVHs must outlive the traversal. RT-safe.
  void start(const TriangleBvh& a, const TriangleBvh& b, const Sweep& sweep) noexcept;
  bool resume(VisitBudget& budget) noexcept;
  /// Returns true if the room for pairs was sufficient so far. RT-safe.
  bool complete() const noexcept { return !job_.overflow; }

  /// Returns the pairs that certainly intersect, for a traversal with Sweep::classify. Listed pairs are
  /// then in doubt, all others are separate. RT-safe.
  std::span<const TrianglePair> intersecting() const noexcept {
    return std::span(pairs_).last(job_.intersecting_count);
  }

  const TrianglePair* begin() const noexcept { return pairs_.data(); }
  const TrianglePair* end() const noexcept { return pairs_.data() + job_.pair_count; }
  std::size_t size() const noexcept { return job_.pair_count; }

 private:
  struct alignas(64) CacheLine {
    unsigned char bytes[64];
  };

  simd::TraversalKernel kernel_;
  simd::TraversalJob job_;
  std::vector<TrianglePair> pairs_;
  std::vector<std::uint32_t> stack_;
  std::vector<CacheLine> moved_leaves_;
};

}  // namespace wrenchd
