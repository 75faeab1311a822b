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

namespace walk {

/// The planes of eight triangles and the corners of eight others, side by side, each as its own body has it.
struct SieveBlock {
  float normal[3][8], offset[8];
  float corner[3][3][8];  ///< [which][component]
};
/// How the tool T moves as the obstacle O sees it, and the other way round: at the start and at the end.
struct SieveWay {
  Transform X_TO[2], X_OT[2];
  float margin;  ///< pairs that are apart by more are left out [m]
};
/// For these blocks, by their numbers: how far apart all of its pairs are at least, all the way, and a bit
/// for every pair that is apart by no more than the margin.
using SieveKernel = void (*)(const SieveBlock* of_obstacle, const SieveBlock* of_tool,
                             const std::uint32_t* which, std::size_t blocks, const SieveWay& way,
                             float* apart_m, std::uint8_t* left) noexcept;
void sift_portable(const SieveBlock* of_obstacle, const SieveBlock* of_tool, const std::uint32_t* which,
                   std::size_t blocks, const SieveWay& way, float* apart_m, std::uint8_t* left) noexcept;
void sift_avx2(const SieveBlock* of_obstacle, const SieveBlock* of_tool, const std::uint32_t* which,
               std::size_t blocks, const SieveWay& way, float* apart_m, std::uint8_t* left) noexcept;

}  // namespace walk

/// Pairs of a triangle of the tool and one of an obstacle, of which most are kept apart all the way by the
/// plane of one of the two, or lie beside each other. Tells which are left: eight at a time, in single
/// precision, and those that it leaves out by a margin.
///
/// It remembers how far apart eight pairs were: they are not asked again before the tool has come so far.
///
/// Memory is taken at construction. One object serves one thread.
class PairSieve {
 public:
  /// Pairs with one obstacle, added one after the other.
  struct Part {
    std::uint32_t obstacle;
    std::uint32_t first_pair, first_block;
    std::uint32_t pairs;
    Frame X_OT_start, X_OT_end;  ///< the way that was asked for last
    double come_m;               ///< how far any point of the tool may have come, from way to way
  };

  /// Room for so many pairs of so many obstacles with a tool of this size, its farthest point from its
  /// centre. kernel: null is the fastest that this processor runs.
  PairSieve(std::size_t pairs, std::size_t obstacles, double tool_radius_m,
            walk::SieveKernel kernel = nullptr);

  void clear() noexcept { parts_.clear(); }
  /// Triangle a of the tool and b of an obstacle, which has this number. There must be room. RT safe.
  void add(const MeshSurface& tool, std::uint32_t a, const MeshSurface& surface, std::uint32_t b,
           std::uint32_t obstacle) noexcept;

  std::span<const Part> parts() const noexcept { return parts_; }

  struct Sifted {
    std::size_t left;   ///< pairs
    std::size_t asked;  ///< pairs that were not known to be far apart
  };
  /// Of the pairs of part k, those that may meet while the tool moves straight from one pose to the other, in
  /// the order in which they were added: their numbers in that order, of all parts. extent_m bounds the
  /// coordinates of both bodies; margin_m: by how much they are to be kept apart, at least, what a chord
  /// leaves out of an arc included. `left` has room for all. RT safe.
  Sifted sift(std::size_t k, const Frame& X_OT_start, const Frame& X_OT_end, double extent_m, double margin_m,
              std::uint32_t* left) noexcept;

 private:
  void come_along(Part& part, const Frame& X_OT_start, const Frame& X_OT_end) noexcept;
  double way_m(const Frame& from, const Frame& to) const noexcept;

  double tool_radius_m_;
  walk::SieveKernel kernel_;
  std::vector<Part> parts_;
  std::vector<walk::SieveBlock> of_obstacle_, of_tool_;
  std::vector<float> apart_m_;  ///< of each block, from where the tool was when come_m was 0
};

}  // namespace wrenchd
