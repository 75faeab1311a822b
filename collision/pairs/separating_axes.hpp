// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "collision/pairs/triangle_intersection.hpp"

namespace wrenchd {

namespace simd {

/// Corners relative to a point between the triangles, in units of the largest coordinate.
struct AxesTriangles {
  float a[2][3][3];  ///< [start, end][corner][component]
  float b[3][3];
  float margin;
};
/// Returns true if a plane separates the triangles on the whole path by more than the margin. RT-safe.
using AxesKernel = bool (*)(const AxesTriangles& pair) noexcept;
bool separated_portable(const AxesTriangles& pair) noexcept;
bool separated_avx2(const AxesTriangles& pair) noexcept;

}  // namespace simd

/// Tests whether a plane separates a triangle that moves straight from a triangle at rest. It tests the
/// planes that contain an edge and the normal of one triangle, and the planes parallel to an edge of each.
/// The pair culler (pair_culler.hpp) tests all other planes. The test runs in single precision, relative to a
/// nearby point, so that a margin of 1 nm is significant between small triangles.
class SeparatingAxes {
 public:
  /// kernel: null selects the fastest kernel for this processor.
  explicit SeparatingAxes(simd::AxesKernel kernel = nullptr);

  /// Returns true if a plane separates the triangles by more than margin_m [m]. False does not imply that
  /// they meet. RT-safe.
  bool separated(const Triangle& a_start, const Triangle& a_end, const Triangle& b,
                 double margin_m) const noexcept;

 private:
  simd::AxesKernel kernel_;
};

}  // namespace wrenchd
