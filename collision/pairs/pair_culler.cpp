// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/pairs/pair_culler.hpp"

#include <algorithm>
#include <array>
#include <numbers>

#include "collision/pairs/bvh_traversal.hpp"

namespace wrenchd {
namespace {

constexpr std::uint32_t kWidth = 8;
constexpr float kUnknownSeparation = -1e30F;  // separation of a block that was not tested
/// Stored separations expire after a displacement of this multiple of the tool's size.
constexpr double kExpiry = 1.0;

void store_pair(simd::PairBlock& block, std::uint32_t lane, const MeshSurface& planes, std::uint32_t plane,
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
              : simd::has_avx2() ? simd::cull_avx2
                                 : simd::cull_portable),
      obstacle_blocks_(pairs / kWidth + obstacles + 1),
      tool_blocks_(obstacle_blocks_.size()),
      separation_m_(obstacle_blocks_.size()) {
  groups_.reserve(obstacles);
}

void PairCuller::add(const MeshSurface& tool, std::uint32_t a, const MeshSurface& surface, std::uint32_t b,
                     std::uint32_t obstacle) noexcept {
  if (groups_.empty() || groups_.back().obstacle != obstacle) {
    Group group = {};
    group.obstacle = obstacle;
    if (!groups_.empty()) {
      const Group& last = groups_.back();
      group.first_pair = last.first_pair + last.pairs;
      group.first_block = last.first_block + (last.pairs + kWidth - 1) / kWidth;
    }
    groups_.push_back(group);
  }
  Group& group = groups_.back();
  const std::uint32_t block = group.first_block + group.pairs / kWidth, lane = group.pairs % kWidth;
  store_pair(obstacle_blocks_[block], lane, surface, b, tool, a);
  store_pair(tool_blocks_[block], lane, tool, a, surface, b);
  separation_m_[block] = kUnknownSeparation;
  ++group.pairs;
}

/// A point of the obstacle that touches the tool is at most as far from the tool's centre as the tool's own
/// farthest point. So a motion that moves no tool point by more than d brings the obstacle's point nearer to
/// any plane or bound of the tool by at most d.
PairCuller::CullResult PairCuller::cull(std::size_t k, const Frame& X_OT_start, const Frame& X_OT_end,
                                        double extent_m, double margin_m, std::uint32_t* remaining) noexcept {
  constexpr std::uint32_t kBatch = 64;
  Group& group = groups_[k];
  accumulate_displacement(group, X_OT_start, X_OT_end);
  simd::CullPath path;
  const std::array<const Frame*, 2> end_poses = {&X_OT_start, &X_OT_end};
  double farthest_m = 0.0;
  for (std::size_t e = 0; e < 2; ++e) {
    const Frame& X_OT = *end_poses[e];
    path.X_OT[e] = simd::to_single(X_OT.R, X_OT.x_m);
    path.X_TO[e] = simd::to_single(X_OT.R.transpose(), -(X_OT.R.transpose() * X_OT.x_m));
    farthest_m = std::max(farthest_m, X_OT.x_m.norm());
  }
  path.margin = static_cast<float>(simd::kRounding * (extent_m + farthest_m) + margin_m);
  const auto displacement = static_cast<float>(group.displacement_m);
  const float known_separation = path.margin + displacement, separation_offset = displacement - path.margin;
  std::array<std::uint32_t, kBatch> block_indices;
  std::array<std::uint8_t, kBatch> bits;
  CullResult result = {};
  const std::uint32_t end = group.first_block + (group.pairs + kWidth - 1) / kWidth;
  for (std::uint32_t block = group.first_block; block < end;) {
    std::uint32_t count = 0;
    for (; block < end && count < kBatch; ++block) {
      block_indices[count] = block;
      count += separation_m_[block] > known_separation ? 0 : 1;
    }
    kernel_(obstacle_blocks_.data(), tool_blocks_.data(), block_indices.data(), count, path,
            separation_m_.data(), bits.data());
    result.tested += kWidth * count;
    for (std::uint32_t i = 0; i < count; ++i) {
      separation_m_[block_indices[i]] += separation_offset;
      for (unsigned lanes = bits[i]; lanes != 0; lanes &= lanes - 1) {
        const std::uint32_t pair = kWidth * (block_indices[i] - group.first_block) +
                                   static_cast<std::uint32_t>(__builtin_ctz(lanes));
        if (pair < group.pairs) remaining[result.remaining++] = group.first_pair + pair;
      }
    }
  }
  return result;
}

/// Every pose of this path is at most as far from a pose of the previous path as the farther one of its ends.
void PairCuller::accumulate_displacement(Group& group, const Frame& X_OT_start,
                                         const Frame& X_OT_end) noexcept {
  const auto from_path_m = [&](const Frame& X) {
    return std::min(displacement_bound_m(group.X_OT_start, X), displacement_bound_m(group.X_OT_end, X));
  };
  group.displacement_m += std::max(from_path_m(X_OT_start), from_path_m(X_OT_end));
  if (!(group.displacement_m < kExpiry * tool_radius_m_)) {
    group.displacement_m = 0.0;
    const std::uint32_t blocks = (group.pairs + kWidth - 1) / kWidth;
    std::fill_n(separation_m_.begin() + group.first_block, blocks, kUnknownSeparation);
  }
  group.X_OT_start = X_OT_start;
  group.X_OT_end = X_OT_end;
}

/// METHOD (92), from rotation matrices. The norm of the difference of two rotations is 2 sqrt(2) sin(angle /
/// 2). If the chord is at most 1, the angle is at most pi/3 times the chord.
double PairCuller::displacement_bound_m(const Frame& from, const Frame& to) const noexcept {
  constexpr double kArc = std::numbers::pi / 3.0;
  const double chord = (to.R - from.R).norm() / std::numbers::sqrt2;
  return (to.x_m - from.x_m).norm() + tool_radius_m_ * (chord <= 1.0 ? kArc * chord : std::numbers::pi);
}

}  // namespace wrenchd
