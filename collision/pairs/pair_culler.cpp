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

void put(walk::SieveBlock& block, std::uint32_t lane, const MeshSurface& planes, std::uint32_t plane,
         const MeshSurface& corners, std::uint32_t triangle) noexcept {
  for (int d = 0; d < 3; ++d) block.normal[d][lane] = static_cast<float>(planes.planes()[plane].normal[d]);
  block.offset[lane] = static_cast<float>(planes.planes()[plane].offset_m);
  for (int k = 0; k < 3; ++k)
    for (int d = 0; d < 3; ++d)
      block.corner[k][d][lane] = static_cast<float>(corners.corner_m(triangle, k)[d]);
}

}  // namespace

PairSieve::PairSieve(std::size_t pairs, std::size_t obstacles, double tool_radius_m, walk::SieveKernel kernel)
    : tool_radius_m_(tool_radius_m),
      kernel_(kernel != nullptr  ? kernel
              : walk::has_avx2() ? walk::sift_avx2
                                 : walk::sift_portable),
      of_obstacle_(pairs / kWidth + obstacles + 1),
      of_tool_(of_obstacle_.size()),
      apart_m_(of_obstacle_.size()) {
  parts_.reserve(obstacles);
}

void PairSieve::add(const MeshSurface& tool, std::uint32_t a, const MeshSurface& surface, std::uint32_t b,
                    std::uint32_t obstacle) noexcept {
  if (parts_.empty() || parts_.back().obstacle != obstacle) {
    Part part = {};
    part.obstacle = obstacle;
    if (!parts_.empty()) {
      const Part& last = parts_.back();
      part.first_pair = last.first_pair + last.pairs;
      part.first_block = last.first_block + (last.pairs + kWidth - 1) / kWidth;
    }
    parts_.push_back(part);
  }
  Part& part = parts_.back();
  const std::uint32_t block = part.first_block + part.pairs / kWidth, lane = part.pairs % kWidth;
  put(of_obstacle_[block], lane, surface, b, tool, a);
  put(of_tool_[block], lane, tool, a, surface, b);
  apart_m_[block] = kUnknown;
  ++part.pairs;
}

/// A point of the obstacle that comes to touch the tool is then no farther from its centre than its own
/// points are: a motion that brings none of those farther than so much brought that point no nearer to any
/// plane of the tool, or to any of its bounds, by more.
PairSieve::Sifted PairSieve::sift(std::size_t k, const Frame& X_OT_start, const Frame& X_OT_end,
                                  double extent_m, double margin_m, std::uint32_t* left) noexcept {
  constexpr std::uint32_t kAtOnce = 64;
  Part& part = parts_[k];
  come_along(part, X_OT_start, X_OT_end);
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
  const auto come = static_cast<float>(part.come_m);
  const float still_apart = way.margin + come, learned = come - way.margin;
  std::array<std::uint32_t, kAtOnce> which;
  std::array<std::uint8_t, kAtOnce> bits;
  Sifted sifted = {};
  const std::uint32_t end = part.first_block + (part.pairs + kWidth - 1) / kWidth;
  for (std::uint32_t block = part.first_block; block < end;) {
    std::uint32_t some = 0;
    for (; block < end && some < kAtOnce; ++block) {
      which[some] = block;
      some += apart_m_[block] > still_apart ? 0 : 1;
    }
    kernel_(of_obstacle_.data(), of_tool_.data(), which.data(), some, way, apart_m_.data(), bits.data());
    sifted.asked += kWidth * some;
    for (std::uint32_t i = 0; i < some; ++i) {
      apart_m_[which[i]] += learned;
      for (unsigned lanes = bits[i]; lanes != 0; lanes &= lanes - 1) {
        const std::uint32_t pair =
            kWidth * (which[i] - part.first_block) + static_cast<std::uint32_t>(__builtin_ctz(lanes));
        if (pair < part.pairs) left[sifted.left++] = part.first_pair + pair;
      }
    }
  }
  return sifted;
}

/// Every pose on this way is as near to one on the way before it as the farther of its ends is.
void PairSieve::come_along(Part& part, const Frame& X_OT_start, const Frame& X_OT_end) noexcept {
  const auto from_there_m = [&](const Frame& X) {
    return std::min(way_m(part.X_OT_start, X), way_m(part.X_OT_end, X));
  };
  part.come_m += std::max(from_there_m(X_OT_start), from_there_m(X_OT_end));
  if (!(part.come_m < kFar * tool_radius_m_)) {
    part.come_m = 0.0;
    const std::uint32_t blocks = (part.pairs + kWidth - 1) / kWidth;
    std::fill_n(apart_m_.begin() + part.first_block, blocks, kUnknown);
  }
  part.X_OT_start = X_OT_start;
  part.X_OT_end = X_OT_end;
}

/// How far a point of the tool may be moved from one pose to the other. The norm of the difference of two
/// rotations is 2 sqrt(2) sin(angle / 2); the angle is at most pi/3 times as long as its chord where that is
/// at most 1.
double PairSieve::way_m(const Frame& from, const Frame& to) const noexcept {
  constexpr double kArc = std::numbers::pi / 3.0;
  const double chord = (to.R - from.R).norm() / std::numbers::sqrt2;
  return (to.x_m - from.x_m).norm() + tool_radius_m_ * (chord <= 1.0 ? kArc * chord : std::numbers::pi);
}

}  // namespace wrenchd
