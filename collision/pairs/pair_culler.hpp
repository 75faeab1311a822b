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

/// The planes of eight triangles of one body and the corners of eight triangles of the other. Each is in the
/// frame of its own body.
struct PairBlock {
  float normal[3][8], offset[8];
  float corner[3][3][8];  ///< [corner][component]
};
/// The path of the tool T in the frame of the obstacle O, and its inverse, at start and end.
struct CullPath {
  Transform X_TO[2], X_OT[2];
  float margin;  ///< separation beyond which a pair is culled [m]
};
/// Tests the given blocks. For each block it stores a lower bound of the separation of its pairs on the whole
/// path, and a bit mask of the pairs whose separation is at most the margin. RT-safe.
using CullKernel = void (*)(const PairBlock* obstacle_blocks, const PairBlock* tool_blocks,
                            const std::uint32_t* block_indices, std::size_t blocks, const CullPath& path,
                            float* separation_m, std::uint8_t* remaining) noexcept;
void cull_portable(const PairBlock* obstacle_blocks, const PairBlock* tool_blocks,
                   const std::uint32_t* block_indices, std::size_t blocks, const CullPath& path,
                   float* separation_m, std::uint8_t* remaining) noexcept;
void cull_avx2(const PairBlock* obstacle_blocks, const PairBlock* tool_blocks,
               const std::uint32_t* block_indices, std::size_t blocks, const CullPath& path,
               float* separation_m, std::uint8_t* remaining) noexcept;

}  // namespace simd

/// Removes candidate pairs that do not meet on a path. The plane of one of the two triangles, or their
/// bounds, separate most pairs on the whole path. The test runs on eight pairs at a time in single precision,
/// with a margin for rounding.
///
/// The culler stores the separation of each block of eight pairs. It tests the block again only when the tool
/// has moved by that distance.
///
/// The constructor allocates all memory. One object serves one thread. All members but the constructor are
/// RT-safe.
class PairCuller {
 public:
  /// The consecutive pairs with one obstacle.
  struct Group {
    std::uint32_t obstacle;
    std::uint32_t first_pair, first_block;
    std::uint32_t pairs;
    Frame X_OT_start, X_OT_end;  ///< path of the last query
    /// upper bound of the displacement of any tool point since separation_m_ was reset
    double displacement_m;
  };

  /// Allocates room for the pairs of a tool of this radius (distance of its farthest point from the centre of
  /// mass). kernel: null selects the fastest kernel for this processor. Not RT-safe: allocates.
  PairCuller(std::size_t pairs, std::size_t obstacles, double tool_radius_m,
             simd::CullKernel kernel = nullptr);

  void clear() noexcept { groups_.clear(); }
  /// Adds triangle a of the tool and triangle b of an obstacle. obstacle: index of the obstacle.
  /// Precondition: there is room. RT-safe.
  void add(const MeshSurface& tool, std::uint32_t a, const MeshSurface& surface, std::uint32_t b,
           std::uint32_t obstacle) noexcept;

  std::span<const Group> groups() const noexcept { return groups_; }

  struct CullResult {
    std::size_t remaining;  ///< pairs that may meet
    std::size_t tested;     ///< pairs that were tested; the stored separation decided the others
  };
  /// Finds the pairs of group k that may meet while the tool moves straight between two poses. Writes their
  /// indices, in the order of add(), to `left`, which must have room for all pairs.
  /// extent_m: bound of the coordinates of both bodies. margin_m: minimum separation of a culled pair,
  /// including the arc deviation [m]. RT-safe.
  CullResult cull(std::size_t k, const Frame& X_OT_start, const Frame& X_OT_end, double extent_m,
                  double margin_m, std::uint32_t* remaining) noexcept;

 private:
  void accumulate_displacement(Group& group, const Frame& X_OT_start, const Frame& X_OT_end) noexcept;
  double displacement_bound_m(const Frame& from, const Frame& to) const noexcept;

  double tool_radius_m_;
  simd::CullKernel kernel_;
  std::vector<Group> groups_;
  std::vector<simd::PairBlock> obstacle_blocks_, tool_blocks_;
  std::vector<float> separation_m_;  ///< lower bound of each block's separation at displacement_m = 0
};

}  // namespace wrenchd
