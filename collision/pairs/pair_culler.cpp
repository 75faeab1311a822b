// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/pairs/pair_culler.hpp"

#include <algorithm>
#include <array>
#include <numbers>

#include "collision/pairs/bvh_traversal.hpp"

namespace wrenchd {
namespace {

constexpr std::uint32_t kWidth = 8;
constexpr float kUnknown = -1e30F;  // how far apart a block is
/// After so many times the size of the tool nothing is known any more.
constexpr double kFar = 1.0;

void put(simd::PairBlock& block, std::uint32_t lane, const MeshSurface& planes, std::uint32_t plane,
         const MeshSurface& corners, std::uint32_t triangle) noexcept {
  for (int d = 0; d < 3; ++d) block.normal[d][lane] = static_cast<float>(planes.planes()[plane].normal[d]);
  block.offset[lane] = static_cast<float>(planes.planes()[plane].offset_m);
  for (int k = 0; k < 3; ++k)
    for (int d = 0; d < 3; ++d)
      block.corner[k][d][lane] = static_cast<float>(corners.corner_m(triangle, k)[d]);
}

}  // namespace

PairCuller::PairCuller(std::size_t pairs, std::size_t obstacles, double tool_radius_m,
                       simd::CullKernel kernel)
    : tool_radius_m_(tool_radius_m),
      kernel_(kernel != nullptr  ? kernel
              : simd::has_avx2() ? simd::sift_avx2
                                 : simd::sift_portable),
      obstacle_blocks_(pairs / kWidth + obstacles + 1),
      tool_blocks_(obstacle_blocks_.size()),
      separation_m_(obstacle_blocks_.size()) {
  groups_.reserve(obstacles);
}

void PairCuller::add(const MeshSurface& tool, std::uint32_t a, const MeshSurface& surface, std::uint32_t b,
                     std::uint32_t obstacle) noexcept {
  if (groups_.empty() || groups_.back().obstacle != obstacle) {
    Group part = {};
    part.obstacle = obstacle;
    if (!groups_.empty()) {
      const Group& last = groups_.back();
      part.first_pair = last.first_pair + last.pairs;
      part.first_block = last.first_block + (last.pairs + kWidth - 1) / kWidth;
    }
    groups_.push_back(part);
  }
  Group& part = groups_.back();
  const std::uint32_t block = part.first_block + part.pairs / kWidth, lane = part.pairs % kWidth;
  put(obstacle_blocks_[block], lane, surface, b, tool, a);
  put(tool_blocks_[block], lane, tool, a, surface, b);
  separation_m_[block] = kUnknown;
  ++part.pairs;
}

/// A point of the obstacle that comes to touch the tool is then no farther from its centre than its own
/// points are: a motion that brings none of those farther than so much brought that point no nearer to any
/// plane of the tool, or to any of its bounds, by more.
PairCuller::CullResult PairCuller::cull(std::size_t k, const Frame& X_OT_start, const Frame& X_OT_end,
                                        double extent_m, double margin_m, std::uint32_t* left) noexcept {
  constexpr std::uint32_t kAtOnce = 64;
  Group& part = groups_[k];
  accumulate_displacement(part, X_OT_start, X_OT_end);
  simd::CullPath way;
  const std::array<const Frame*, 2> ends = {&X_OT_start, &X_OT_end};
  double farthest_m = 0.0;
  for (std::size_t e = 0; e < 2; ++e) {
    const Frame& X_OT = *ends[e];
    way.X_OT[e] = simd::to_single(X_OT.R, X_OT.x_m);
    way.X_TO[e] = simd::to_single(X_OT.R.transpose(), -(X_OT.R.transpose() * X_OT.x_m));
    farthest_m = std::max(farthest_m, X_OT.x_m.norm());
  }
  way.margin = static_cast<float>(simd::kRounding * (extent_m + farthest_m) + margin_m);
  const auto come = static_cast<float>(part.displacement_m);
  const float still_apart = way.margin + come, learned = come - way.margin;
  std::array<std::uint32_t, kAtOnce> which;
  std::array<std::uint8_t, kAtOnce> bits;
  CullResult sifted = {};
  const std::uint32_t end = part.first_block + (part.pairs + kWidth - 1) / kWidth;
  for (std::uint32_t block = part.first_block; block < end;) {
    std::uint32_t some = 0;
    for (; block < end && some < kAtOnce; ++block) {
      which[some] = block;
      some += separation_m_[block] > still_apart ? 0 : 1;
    }
    kernel_(obstacle_blocks_.data(), tool_blocks_.data(), which.data(), some, way, separation_m_.data(),
            bits.data());
    sifted.tested += kWidth * some;
    for (std::uint32_t i = 0; i < some; ++i) {
      separation_m_[which[i]] += learned;
      for (unsigned lanes = bits[i]; lanes != 0; lanes &= lanes - 1) {
        const std::uint32_t pair =
            kWidth * (which[i] - part.first_block) + static_cast<std::uint32_t>(__builtin_ctz(lanes));
        if (pair < part.pairs) left[sifted.remaining++] = part.first_pair + pair;
      }
    }
  }
  return sifted;
}

/// Every pose on this way is as near to one on the way before it as the farther of its ends is.
void PairCuller::accumulate_displacement(Group& part, const Frame& X_OT_start,
                                         const Frame& X_OT_end) noexcept {
  const auto from_there_m = [&](const Frame& X) {
    return std::min(displacement_bound_m(part.X_OT_start, X), displacement_bound_m(part.X_OT_end, X));
  };
  part.displacement_m += std::max(from_there_m(X_OT_start), from_there_m(X_OT_end));
  if (!(part.displacement_m < kFar * tool_radius_m_)) {
    part.displacement_m = 0.0;
    const std::uint32_t blocks = (part.pairs + kWidth - 1) / kWidth;
    std::fill_n(separation_m_.begin() + part.first_block, blocks, kUnknown);
  }
  part.X_OT_start = X_OT_start;
  part.X_OT_end = X_OT_end;
}

/// How far a point of the tool may be moved from one pose to the other. The norm of the difference of two
/// rotations is 2 sqrt(2) sin(angle / 2); the angle is at most pi/3 times as long as its chord where that is
/// at most 1.
double PairCuller::displacement_bound_m(const Frame& from, const Frame& to) const noexcept {
  constexpr double kArc = std::numbers::pi / 3.0;
  const double chord = (to.R - from.R).norm() / std::numbers::sqrt2;
  return (to.x_m - from.x_m).norm() + tool_radius_m_ * (chord <= 1.0 ? kArc * chord : std::numbers::pi);
}

}  // namespace wrenchd
