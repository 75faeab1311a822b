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

/// A triangle of A and one of B.
struct TrianglePair {
  std::uint32_t a, b;

  friend bool operator==(const TrianglePair&, const TrianglePair&) = default;
};

/// A moves in B from one pose to another.
struct Sweep {
  Pose X_BA_start, X_BA_end;
  /// Pairs are to be found not only for the poses on the way but for every one near them: as far as this
  /// from one of them in all, |shift| + angle times the farthest point of A.
  double reach_m = 0.0;
  /// False: list only pairs with features that can meet first, a vertex in one of them or an edge in each.
  bool all_pairs = true;
  /// For a single pose without reach, all pairs: which meet there is told as far as single precision can.
  bool classify = false;
};

/// How much work a walk may do, and did: it is counted in work and not in time, so that a replay does the
/// same.
struct VisitBudget {
  std::uint32_t remaining = 0;  ///< nodes and leaves looked at
  std::uint32_t reserved = 0;   ///< of these, so many are not for what can wait until the next tick
};

namespace simd {

/// What the kernels work on: plain arrays (single_precision.hpp).
struct RelativeMotion {
  Transform X_BA_middle, X_AB_middle;  ///< half way
  Transform X_BA_start, X_BA_end;
  Transform displacement_BA,
      displacement_AB;  ///< R p + t is by how much a point of A, seen from B, moves in all
  float half_angle;     ///< half the angle in all [rad]
  float margin;         ///< by which all boxes grow [m]
  float reach, radius;  ///< a plane of A may come nearer to a point by reach * max(1, its distance / radius),
                        ///< what a chord leaves out of an arc included
  float rounding;
  float centre_B[3];    ///< of A at the end, from which that distance counts
  float centre_travel;  ///< how far the centre has come [m]
  bool moving;
  bool all_pairs;
  bool classify;
};
struct BvhArrays {
  const TriangleBvh::Box* boxes;
  const TriangleBvh::Node* nodes;
  const TriangleBvh::Leaf* leaves;
};
/// A walk under way: it may be interrupted after any visit.
struct TraversalJob {
  BvhArrays a, b;
  RelativeMotion motion;
  TrianglePair* pairs;  ///< room for pairs: listed from the front, those that surely meet from the back
  std::uint32_t capacity;
  std::uint32_t* stack;  ///< room for kStack pairs of box numbers
  void* moved_leaves;    ///< room for kMovedLeavesBytes, aligned to 64
  std::uint32_t max_node_visits = 0;
  // How far it has come:
  std::uint32_t node_visits = 0, pair_count = 0, intersecting_count = 0, stack_top = 0;
  bool started = false;
  bool overflow = false;  ///< there was no room for all
};
constexpr std::size_t kStack = 8192;
constexpr std::size_t kMovedLeavesBytes = std::size_t{1} << 17;

/// Goes on until the stack is empty, there is no room, or the visits are used up.
using TraversalKernel = void (*)(TraversalJob&) noexcept;
void walk_portable(TraversalJob& job) noexcept;
void walk_avx2(TraversalJob& job) noexcept;
/// Does this processor run walk_avx2()?
bool has_avx2() noexcept;

}  // namespace simd

/// Walks two trees together and lists the pairs of triangles that may meet.
///
/// No pair that comes to touch on the way is left out (points of A are taken to move straight from start to
/// end), nor one that touches at a pose within reach of the way. Pairs that a plane of one of the two
/// triangles keeps apart all the way are left out, most others that do not meet too; what remains must be
/// looked at in double precision. Which pairs remain depends on the processor, whether a pair that meets is
/// among them does not.
///
/// All memory is taken at construction. One object serves one thread.
class BvhTraversal {
 public:
  static constexpr std::size_t kCapacity = std::size_t{1} << 16;

  explicit BvhTraversal(
      simd::TraversalKernel kernel = nullptr);  ///< null: the fastest that this processor runs

  /// False where the list or the budget was too small; what was found is there. The budget falls by the work
  /// done. RT safe.
  bool find(const TriangleBvh& a, const TriangleBvh& b, const Sweep& sweep, VisitBudget& budget) noexcept {
    start(a, b, sweep);
    return resume(budget) && complete();
  }

  /// The same in parts: sets out, goes on until the budget is used up; true: the walk has ended. The trees
  /// must outlive it. RT safe.
  void start(const TriangleBvh& a, const TriangleBvh& b, const Sweep& sweep) noexcept;
  bool resume(VisitBudget& budget) noexcept;
  /// Was there room for all pairs, as far as it came?
  bool complete() const noexcept { return !job_.overflow; }

  /// Of a walk that settles: pairs that meet for sure. What is listed besides is in doubt, what is not
  /// listed is apart.
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
