// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstring>

#if defined(__AVX2__)
#include <immintrin.h>
#endif

// Vectors of eight floats for the kernels. The kernels are compiled once per instruction set, and the
// compiler translates the vector types to its registers. Intrinsics are used only where the compiler does not
// find the best instruction.

namespace wrenchd::simd {
namespace {

constexpr int kWidth = 8;
using Float8 = float __attribute__((vector_size(32)));
using Mask8 = int __attribute__((vector_size(32)));

#define WRENCHD_INLINE inline __attribute__((always_inline))

WRENCHD_INLINE Float8 load(const float* p) noexcept {
  Float8 v;
  std::memcpy(&v, p, sizeof v);
  return v;
}
WRENCHD_INLINE void store(float* p, Float8 v) noexcept {
  std::memcpy(p, &v, sizeof v);
}
WRENCHD_INLINE Float8 broadcast(float x) noexcept {
  return Float8{} + x;
}
#if defined(__AVX2__)
WRENCHD_INLINE Float8 lane_min(Float8 a, Float8 b) noexcept {
  return _mm256_min_ps(a, b);
}
WRENCHD_INLINE Float8 lane_max(Float8 a, Float8 b) noexcept {
  return _mm256_max_ps(a, b);
}
WRENCHD_INLINE unsigned lane_mask(Mask8 m) noexcept {
  return static_cast<unsigned>(_mm256_movemask_ps(reinterpret_cast<__m256>(m)));
}
#else
WRENCHD_INLINE Float8 lane_min(Float8 a, Float8 b) noexcept {
  return a < b ? a : b;
}
WRENCHD_INLINE Float8 lane_max(Float8 a, Float8 b) noexcept {
  return a > b ? a : b;
}
WRENCHD_INLINE unsigned lane_mask(Mask8 m) noexcept {
  unsigned out = 0;
  for (int i = 0; i < kWidth; ++i) out |= (m[i] != 0 ? 1U : 0U) << i;
  return out;
}
#endif
WRENCHD_INLINE Float8 magnitude(Float8 x) noexcept {
  return lane_max(x, -x);
}

}  // namespace
}  // namespace wrenchd::simd
