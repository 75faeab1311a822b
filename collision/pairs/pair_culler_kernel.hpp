// SPDX-License-Identifier: GPL-3.0-or-later
// No #pragma once: one source file per instruction set includes this header and compiles it in a namespace of
// its own. WRENCHD_CULL is the name of the function.

#include "collision/pairs/float8.hpp"
#include "collision/pairs/pair_culler.hpp"

namespace wrenchd::simd {
namespace {

/// Returns the distance by which eight planes keep their triangles on one side at both ends. Negative: the
/// plane does not separate.
/// X transforms the frame P of the plane to the frame Q of the corners: n_Q = R n_P, and n_Q . x = n_P . x_P
/// + n_Q . t.
WRENCHD_INLINE Float8 plane_separation(const PairBlock& block, const Transform (&X_QP)[2]) noexcept {
  Float8 lowest = broadcast(3e38F), highest = broadcast(-3e38F);
  const Float8 nx = load(block.normal[0]), ny = load(block.normal[1]), nz = load(block.normal[2]);
  for (const Transform& X : X_QP) {
    Float8 n[3], offset = load(block.offset);
    for (int d = 0; d < 3; ++d) {
      n[d] = nx * X.R[d][0] + ny * X.R[d][1] + nz * X.R[d][2];
      offset += n[d] * X.t[d];
    }
    for (const auto& corner : block.corner) {
      const Float8 height = n[0] * load(corner[0]) + n[1] * load(corner[1]) + n[2] * load(corner[2]) - offset;
      lowest = lane_min(lowest, height);
      highest = lane_max(highest, height);
    }
  }
  return lane_max(lowest, -highest);
}

/// Returns the distance between the bounds of eight pairs over the whole path, in the obstacle's frame.
WRENCHD_INLINE Float8 bounds_separation(const PairBlock& tool, const PairBlock& obstacle,
                                        const Transform (&X_OT)[2]) noexcept {
  Float8 separation = broadcast(-3e38F);
  for (int d = 0; d < 3; ++d) {
    Float8 low_a = broadcast(3e38F), high_a = broadcast(-3e38F), low_b = low_a, high_b = high_a;
    for (int k = 0; k < 3; ++k) {
      for (const Transform& X : X_OT) {
        const Float8 p = load(tool.corner[k][0]) * X.R[d][0] + load(tool.corner[k][1]) * X.R[d][1] +
                         load(tool.corner[k][2]) * X.R[d][2] + X.t[d];
        low_a = lane_min(low_a, p);
        high_a = lane_max(high_a, p);
      }
      low_b = lane_min(low_b, load(obstacle.corner[k][d]));
      high_b = lane_max(high_b, load(obstacle.corner[k][d]));
    }
    separation = lane_max(separation, lane_max(low_a - high_b, low_b - high_a));
  }
  return separation;
}

WRENCHD_INLINE float horizontal_min(Float8 x) noexcept {
  x = lane_min(x, __builtin_shufflevector(x, x, 4, 5, 6, 7, 0, 1, 2, 3));
  x = lane_min(x, __builtin_shufflevector(x, x, 2, 3, 0, 1, 6, 7, 4, 5));
  x = lane_min(x, __builtin_shufflevector(x, x, 1, 0, 3, 2, 5, 4, 7, 6));
  return x[0];
}

}  // namespace

void WRENCHD_CULL(const PairBlock* obstacle_blocks, const PairBlock* tool_blocks,
                  const std::uint32_t* block_indices, std::size_t blocks, const CullPath& path,
                  float* separation_m, std::uint8_t* remaining) noexcept {
  for (std::size_t i = 0; i < blocks; ++i) {
    const std::uint32_t block = block_indices[i];
    Float8 separation = plane_separation(obstacle_blocks[block], path.X_TO);
    if (lane_mask(separation > path.margin) != 255)
      separation = lane_max(separation, plane_separation(tool_blocks[block], path.X_OT));
    if (lane_mask(separation > path.margin) != 255)
      separation =
          lane_max(separation, bounds_separation(obstacle_blocks[block], tool_blocks[block], path.X_OT));
    separation_m[block] = horizontal_min(separation);
    remaining[i] = static_cast<std::uint8_t>(lane_mask(separation > path.margin) ^ 255U);
  }
}

}  // namespace wrenchd::simd
