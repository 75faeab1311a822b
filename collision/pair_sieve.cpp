// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/pair_sieve.hpp"

#include <algorithm>
#include <array>

#include "collision/tree_walk.hpp"

namespace wrenchd {
namespace {

constexpr std::uint32_t kWidth = 8;
void put(walk::SieveBlock& block, std::uint32_t lane, const MeshSurface& planes, std::uint32_t plane,
         const MeshSurface& corners, std::uint32_t triangle) noexcept {
  for (int d = 0; d < 3; ++d) block.normal[d][lane] = static_cast<float>(planes.planes()[plane].normal[d]);
  block.offset[lane] = static_cast<float>(planes.planes()[plane].offset_m);
  for (int k = 0; k < 3; ++k)
    for (int d = 0; d < 3; ++d)
      block.corner[k][d][lane] = static_cast<float>(corners.corner_m(triangle, k)[d]);
}

}  // namespace

PairSieve::PairSieve(std::size_t pairs, std::size_t obstacles, walk::SieveKernel kernel)
    : kernel_(kernel != nullptr  ? kernel
              : walk::has_avx2() ? walk::sift_avx2
                                 : walk::sift_portable),
      of_obstacle_(pairs / kWidth + obstacles + 1),
      of_tool_(of_obstacle_.size()) {
  parts_.reserve(obstacles);
}

void PairSieve::add(const MeshSurface& tool, std::uint32_t a, const MeshSurface& surface, std::uint32_t b,
                    std::uint32_t obstacle) noexcept {
  if (parts_.empty() || parts_.back().obstacle != obstacle) {
    const Part last = parts_.empty() ? Part{} : parts_.back();
    parts_.push_back(
        {obstacle, last.first_pair + last.pairs, last.first_block + (last.pairs + kWidth - 1) / kWidth, 0});
  }
  Part& part = parts_.back();
  const std::uint32_t block = part.first_block + part.pairs / kWidth, lane = part.pairs % kWidth;
  put(of_obstacle_[block], lane, surface, b, tool, a);
  put(of_tool_[block], lane, tool, a, surface, b);
  ++part.pairs;
}

std::size_t PairSieve::sift(const Part& part, const Frame& X_OT_start, const Frame& X_OT_end, double extent_m,
                            double margin_m, std::uint32_t* left) const noexcept {
  constexpr std::uint32_t kAtOnce = 64;
  walk::SieveWay way;
  const std::array<const Frame*, 2> ends = {&X_OT_start, &X_OT_end};
  double farthest_m = 0.0;
  for (std::size_t e = 0; e < 2; ++e) {
    const Frame& X_OT = *ends[e];
    way.X_OT[e] = walk::single(X_OT.R, X_OT.x_m);
    way.X_TO[e] = walk::single(X_OT.R.transpose(), -(X_OT.R.transpose() * X_OT.x_m));
    farthest_m = std::max(farthest_m, X_OT.x_m.norm());
  }
  way.margin = static_cast<float>(walk::kRounding * (extent_m + farthest_m) + margin_m);
  std::array<std::uint8_t, kAtOnce> bits;
  std::size_t count = 0;
  const std::uint32_t blocks = (part.pairs + kWidth - 1) / kWidth;
  for (std::uint32_t first = 0; first < blocks; first += kAtOnce) {
    const std::uint32_t some = std::min(kAtOnce, blocks - first);
    kernel_(&of_obstacle_[part.first_block + first], &of_tool_[part.first_block + first], some, way,
            bits.data());
    for (std::uint32_t k = 0; k < some; ++k)
      for (unsigned lanes = bits[k]; lanes != 0; lanes &= lanes - 1) {
        const std::uint32_t pair = kWidth * (first + k) + static_cast<std::uint32_t>(__builtin_ctz(lanes));
        if (pair < part.pairs) left[count++] = part.first_pair + pair;
      }
  }
  return count;
}

}  // namespace wrenchd
