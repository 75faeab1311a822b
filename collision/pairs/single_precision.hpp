// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/pose.hpp"

namespace wrenchd::simd {

/// Error bound of single precision as a fraction of the coordinates: rounding of the input, of two products
/// of three terms each, and of a plane's offset.
constexpr double kRounding = 1.5e-6;

/// The transformation R p + t as plain arrays. The AVX2 translation units must not share inline functions
/// with the rest of the program.
struct Transform {
  float R[3][3];
  float t[3];
};

inline Transform to_single(const Matrix3d& R, const Vector3d& t) noexcept {
  Transform out;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) out.R[i][j] = static_cast<float>(R(i, j));
    out.t[i] = static_cast<float>(t[i]);
  }
  return out;
}

}  // namespace wrenchd::simd
