// SPDX-License-Identifier: GPL-3.0-or-later
// No #pragma once: compiled once for every kind of processor, each in a namespace of its own, and included
// nowhere else. WRENCHD_SIFT names the function.

#include "collision/pairs/float8.hpp"
#include "collision/pairs/pair_culler.hpp"

namespace wrenchd::simd {
namespace {

/// How far eight planes keep their triangles on one side at both ends, at least; less than zero: they do not.
/// X takes the plane's frame P to that of the corners Q: n_Q = R n_P, and n_Q . x = n_P . x_P + n_Q . t.
WRENCHD_INLINE Float8 apart_by_plane(const PairBlock& block, const Transform (&X_QP)[2]) noexcept {
  Float8 lowest = all(3e38F), highest = all(-3e38F);
  const Float8 nx = load(block.normal[0]), ny = load(block.normal[1]), nz = load(block.normal[2]);
  for (const Transform& X : X_QP) {
    Float8 n[3], offset = load(block.offset);
    for (int d = 0; d < 3; ++d) {
      n[d] = nx * X.R[d][0] + ny * X.R[d][1] + nz * X.R[d][2];
      offset += n[d] * X.t[d];
    }
    for (const auto& corner : block.corner) {
      const Float8 height = n[0] * load(corner[0]) + n[1] * load(corner[1]) + n[2] * load(corner[2]) - offset;
      lowest = smaller(lowest, height);
      highest = larger(highest, height);
    }
  }
  return larger(lowest, -highest);
}

/// How far the bounds of eight pairs lie beside each other all the way, as the obstacle sees them.
WRENCHD_INLINE Float8 apart_by_bounds(const PairBlock& tool, const PairBlock& obstacle,
                                      const Transform (&X_OT)[2]) noexcept {
  Float8 apart = all(-3e38F);
  for (int d = 0; d < 3; ++d) {
    Float8 low_a = all(3e38F), high_a = all(-3e38F), low_b = low_a, high_b = high_a;
    for (int k = 0; k < 3; ++k) {
      for (const Transform& X : X_OT) {
        const Float8 p = load(tool.corner[k][0]) * X.R[d][0] + load(tool.corner[k][1]) * X.R[d][1] +
                         load(tool.corner[k][2]) * X.R[d][2] + X.t[d];
        low_a = smaller(low_a, p);
        high_a = larger(high_a, p);
      }
      low_b = smaller(low_b, load(obstacle.corner[k][d]));
      high_b = larger(high_b, load(obstacle.corner[k][d]));
    }
    apart = larger(apart, larger(low_a - high_b, low_b - high_a));
  }
  return apart;
}

WRENCHD_INLINE float least_of(Float8 x) noexcept {
  x = smaller(x, __builtin_shuffle(x, Mask8{4, 5, 6, 7, 0, 1, 2, 3}));
  x = smaller(x, __builtin_shuffle(x, Mask8{2, 3, 0, 1, 6, 7, 4, 5}));
  x = smaller(x, __builtin_shuffle(x, Mask8{1, 0, 3, 2, 5, 4, 7, 6}));
  return x[0];
}

}  // namespace

void WRENCHD_SIFT(const PairBlock* of_obstacle, const PairBlock* of_tool, const std::uint32_t* which,
                  std::size_t blocks, const CullPath& way, float* apart_m, std::uint8_t* left) noexcept {
  for (std::size_t i = 0; i < blocks; ++i) {
    const std::uint32_t block = which[i];
    Float8 apart = apart_by_plane(of_obstacle[block], way.X_TO);
    if (bits(apart > way.margin) != 255) apart = larger(apart, apart_by_plane(of_tool[block], way.X_OT));
    if (bits(apart > way.margin) != 255)
      apart = larger(apart, apart_by_bounds(of_obstacle[block], of_tool[block], way.X_OT));
    apart_m[block] = least_of(apart);
    left[i] = static_cast<std::uint8_t>(bits(apart > way.margin) ^ 255U);
  }
}

}  // namespace wrenchd::simd
