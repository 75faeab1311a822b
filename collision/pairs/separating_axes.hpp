// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "collision/pairs/triangle_intersection.hpp"

namespace wrenchd {

namespace simd {

/// Corners from a place between them, in units of the farthest coordinate.
struct AxesTriangles {
  float a[2][3][3];  ///< [start, end][corner][component]
  float b[3][3];
  float margin;
};
/// True: a plane keeps the two apart all the way, by more than the margin.
using AxesKernel = bool (*)(const AxesTriangles& pair) noexcept;
bool apart_portable(const AxesTriangles& pair) noexcept;
bool apart_avx2(const AxesTriangles& pair) noexcept;

}  // namespace simd

/// Is a triangle that moves straight kept apart from one that stands still by a plane upright on a side of
/// one of them, or parallel to an edge of each? These are the planes that the sieve (pair_sieve.hpp) does not
/// try. In single precision, from a place near by, so that a margin of a nanometre counts between small
/// triangles.
class SeparatingAxes {
 public:
  /// kernel: null is the fastest that this processor runs.
  explicit SeparatingAxes(simd::AxesKernel kernel = nullptr);

  /// False does not say that they meet. margin_m: by how much they are to be kept apart, at least. RT safe.
  bool separated(const Triangle& a_start, const Triangle& a_end, const Triangle& b,
                 double margin_m) const noexcept;

 private:
  simd::AxesKernel kernel_;
};

}  // namespace wrenchd
