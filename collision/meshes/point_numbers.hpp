// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/pose.hpp"

namespace wrenchd {

/// Finds equal points among the points of a list. A hash table with open addressing: one array, no allocation
/// for each point. A million triangles of STL have three million corners, and a tree takes seconds for them.
/// Not RT-safe: allocates.
class PointNumbers {
 public:
  /// points: the list, which the caller extends. expected: number of points that the list will hold.
  explicit PointNumbers(const std::vector<Vector3d>& points, std::size_t expected = 0) : points_(points) {
    slots_.assign(std::bit_ceil(2 * expected + kMinSlots), kFree);
  }

  /// Returns the number of the first point that equals p. If there is none, returns `number` and registers p
  /// under it. The caller ensures that points[number] == p before the next call. Zero and minus zero are
  /// equal. Precondition: p has no NaN.
  std::size_t find_or_add(const Vector3d& p, std::size_t number) {
    if (2 * (count_ + 1) > slots_.size()) grow();
    for (std::size_t i = hash(p);; ++i) {
      std::size_t& slot = slots_[i & (slots_.size() - 1)];
      if (slot == kFree) {
        slot = number;
        ++count_;
        return number;
      }
      if (points_[slot] == p) return slot;
    }
  }

 private:
  static constexpr std::size_t kFree = ~std::size_t{0};
  static constexpr std::size_t kMinSlots = 16;

  static std::size_t hash(const Vector3d& p) noexcept {
    std::uint64_t h = 0;
    for (int i = 0; i < 3; ++i) {
      h = (h ^ std::bit_cast<std::uint64_t>(p[i] + 0.0)) * 0x9e3779b97f4a7c15U;  // + 0.0 turns -0.0 into 0.0
      h ^= h >> 32;
    }
    return static_cast<std::size_t>(h);
  }
  void grow() {
    std::vector<std::size_t> old(2 * slots_.size(), kFree);
    old.swap(slots_);
    for (const std::size_t number : old) {
      if (number == kFree) continue;
      std::size_t i = hash(points_[number]);
      while (slots_[i & (slots_.size() - 1)] != kFree) ++i;
      slots_[i & (slots_.size() - 1)] = number;
    }
  }

  const std::vector<Vector3d>& points_;
  std::vector<std::size_t> slots_;
  std::size_t count_ = 0;
};

}  // namespace wrenchd
