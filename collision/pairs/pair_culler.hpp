// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "collision/meshes/mesh_surface.hpp"
#include "collision/pairs/single_precision.hpp"
#include "core/frame.hpp"

namespace wrenchd {

namespace simd {

/// The planes of eight triangles and the corners of eight others, side by side, each as its own body has it.
struct PairBlock {
  float normal[3][8], offset[8];
  float corner[3][3][8];  ///< [which][component]
};
/// How the tool T moves as the obstacle O sees it, and the other way round: at the start and at the end.
struct CullPath {
  Transform X_TO[2], X_OT[2];
  float margin;  ///< pairs that are apart by more are left out [m]
};
/// For these blocks, by their numbers: how far apart all of its pairs are at least, all the way, and a bit
/// for every pair that is apart by no more than the margin.
using CullKernel = void (*)(const PairBlock* of_obstacle, const PairBlock* of_tool,
                            const std::uint32_t* which, std::size_t blocks, const CullPath& way,
                            float* apart_m, std::uint8_t* left) noexcept;
void sift_portable(const PairBlock* of_obstacle, const PairBlock* of_tool, const std::uint32_t* which,
                   std::size_t blocks, const CullPath& way, float* apart_m, std::uint8_t* left) noexcept;
void sift_avx2(const PairBlock* of_obstacle, const PairBlock* of_tool, const std::uint32_t* which,
               std::size_t blocks, const CullPath& way, float* apart_m, std::uint8_t* left) noexcept;

}  // namespace simd

/// Pairs of a triangle of the tool and one of an obstacle, of which most are kept apart all the way by the
/// plane of one of the two, or lie beside each other. Tells which are left: eight at a time, in single
/// precision, and those that it leaves out by a margin.
///
/// It remembers how far apart eight pairs were: they are not asked again before the tool has come so far.
///
/// Memory is taken at construction. One object serves one thread.
class PairCuller {
 public:
  /// Pairs with one obstacle, added one after the other.
  struct Group {
    std::uint32_t obstacle;
    std::uint32_t first_pair, first_block;
    std::uint32_t pairs;
    Frame X_OT_start, X_OT_end;  ///< the way that was asked for last
    double displacement_m;       ///< how far any point of the tool may have come, from way to way
  };

  /// Room for so many pairs of so many obstacles with a tool of this size, its farthest point from its
  /// centre. kernel: null is the fastest that this processor runs.
  PairCuller(std::size_t pairs, std::size_t obstacles, double tool_radius_m,
             simd::CullKernel kernel = nullptr);

  void clear() noexcept { groups_.clear(); }
  /// Triangle a of the tool and b of an obstacle, which has this number. There must be room. RT safe.
  void add(const MeshSurface& tool, std::uint32_t a, const MeshSurface& surface, std::uint32_t b,
           std::uint32_t obstacle) noexcept;

  std::span<const Group> groups() const noexcept { return groups_; }

  struct CullResult {
    std::size_t remaining;  ///< pairs
    std::size_t tested;     ///< pairs that were not known to be far apart
  };
  /// Of the pairs of part k, those that may meet while the tool moves straight from one pose to the other, in
  /// the order in which they were added: their numbers in that order, of all parts. extent_m bounds the
  /// coordinates of both bodies; margin_m: by how much they are to be kept apart, at least, what a chord
  /// leaves out of an arc included. `left` has room for all. RT safe.
  CullResult cull(std::size_t k, const Frame& X_OT_start, const Frame& X_OT_end, double extent_m,
                  double margin_m, std::uint32_t* left) noexcept;

 private:
  void accumulate_displacement(Group& part, const Frame& X_OT_start, const Frame& X_OT_end) noexcept;
  double displacement_bound_m(const Frame& from, const Frame& to) const noexcept;

  double tool_radius_m_;
  simd::CullKernel kernel_;
  std::vector<Group> groups_;
  std::vector<simd::PairBlock> obstacle_blocks_, tool_blocks_;
  std::vector<float> separation_m_;  ///< of each block, from where the tool was when displacement_m was 0
};

}  // namespace wrenchd
