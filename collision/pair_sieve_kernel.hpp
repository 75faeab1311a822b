// SPDX-License-Identifier: GPL-3.0-or-later
// No #pragma once: compiled once for every kind of processor, each in a namespace of its own, and included
// nowhere else. WRENCHD_SIFT names the function.

#include "collision/eight_wide.hpp"
#include "collision/pair_sieve.hpp"

namespace wrenchd::walk {
namespace {

/// Which of eight planes keep their triangle on one side at both ends. X takes the plane's frame P to that of
/// the corners Q: n_Q = R n_P, and n_Q . x = n_P . x_P + n_Q . t.
WRENCHD_INLINE Mask8 kept_apart(const SieveBlock& block, const Transform (&X_QP)[2], float margin) noexcept {
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
  return (lowest > margin) | (highest < -margin);
}

/// Which of eight pairs have bounds that lie beside each other all the way, as the obstacle sees them.
WRENCHD_INLINE Mask8 beside(const SieveBlock& tool, const SieveBlock& obstacle, const Transform (&X_OT)[2],
                            float margin) noexcept {
  Mask8 apart = {};
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
    apart |= low_a > high_b + margin;
    apart |= low_b > high_a + margin;
  }
  return apart;
}

}  // namespace

void WRENCHD_SIFT(const SieveBlock* of_obstacle, const SieveBlock* of_tool, std::size_t blocks,
                  const SieveWay& way, std::uint8_t* left) noexcept {
  for (std::size_t i = 0; i < blocks; ++i) {
    Mask8 apart = kept_apart(of_obstacle[i], way.X_TO, way.margin);
    if (bits(apart) != 255) apart |= kept_apart(of_tool[i], way.X_OT, way.margin);
    if (bits(apart) != 255) apart |= beside(of_obstacle[i], of_tool[i], way.X_OT, way.margin);
    left[i] = static_cast<std::uint8_t>(bits(apart) ^ 255U);
  }
}

}  // namespace wrenchd::walk
