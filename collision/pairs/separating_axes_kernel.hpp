// SPDX-License-Identifier: GPL-3.0-or-later
// No #pragma once: one source file per instruction set includes this header and compiles it in a namespace of
// its own. WRENCHD_SEPARATED is the name of the function.

#include "collision/pairs/float8.hpp"
#include "collision/pairs/separating_axes.hpp"

namespace wrenchd::simd {
namespace {

struct Vector {
  float x[3];
};

WRENCHD_INLINE Vector between(const float (&from)[3], const float (&to)[3]) noexcept {
  return {{to[0] - from[0], to[1] - from[1], to[2] - from[2]}};
}
WRENCHD_INLINE Vector cross(const Vector& u, const Vector& v) noexcept {
  return {{u.x[1] * v.x[2] - u.x[2] * v.x[1], u.x[2] * v.x[0] - u.x[0] * v.x[2],
           u.x[0] * v.x[1] - u.x[1] * v.x[0]}};
}

/// Tests eight axes u x v. The axes are not normalised, because both triangles are projected on the same
/// axis.
WRENCHD_INLINE bool separated_along(const Float8 (&u)[3], const Float8 (&v)[3],
                                    const AxesTriangles& pair) noexcept {
  const Float8 axis[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
  const auto height = [&](const float(&p)[3]) { return axis[0] * p[0] + axis[1] * p[1] + axis[2] * p[2]; };
  Float8 low_a = height(pair.a[0][0]), high_a = low_a, low_b = height(pair.b[0]), high_b = low_b;
  for (int k = 0; k < 3; ++k) {
    for (const auto& a : pair.a) {
      const Float8 h = height(a[k]);
      low_a = lane_min(low_a, h);
      high_a = lane_max(high_a, h);
    }
    const Float8 h = height(pair.b[k]);
    low_b = lane_min(low_b, h);
    high_b = lane_max(high_b, h);
  }
  const Float8 length =
      magnitude(axis[0]) + magnitude(axis[1]) + magnitude(axis[2]);  // upper bound of the axis length
  return lane_mask(lane_max(low_a - high_b, low_b - high_a) > length * pair.margin) != 0;
}

}  // namespace

bool WRENCHD_SEPARATED(const AxesTriangles& pair) noexcept {
  float middle[3][3];
  for (int k = 0; k < 3; ++k)
    for (int d = 0; d < 3; ++d) middle[k][d] = 0.5F * (pair.a[0][k][d] + pair.a[1][k][d]);
  const Vector e[3] = {between(middle[0], middle[1]), between(middle[1], middle[2]),
                       between(middle[2], middle[0])};
  const Vector f[3] = {between(pair.b[0], pair.b[1]), between(pair.b[1], pair.b[2]),
                       between(pair.b[2], pair.b[0])};
  Float8 u[3], v[3];
  for (int d = 0; d < 3; ++d) {
    u[d] = Float8{e[0].x[d], e[0].x[d], e[0].x[d], e[1].x[d], e[1].x[d], e[1].x[d], e[2].x[d], e[2].x[d]};
    v[d] = Float8{f[0].x[d], f[1].x[d], f[2].x[d], f[0].x[d], f[1].x[d], f[2].x[d], f[0].x[d], f[1].x[d]};
  }
  if (separated_along(u, v, pair)) return true;
  const Vector n = cross(e[0], e[1]), m = cross(f[0], f[1]);
  for (int d = 0; d < 3; ++d) {
    u[d] = Float8{e[2].x[d], m.x[d], m.x[d], m.x[d], n.x[d], n.x[d], n.x[d], n.x[d]};
    v[d] = Float8{f[2].x[d], f[0].x[d], f[1].x[d], f[2].x[d], e[0].x[d], e[1].x[d], e[2].x[d], m.x[d]};
  }
  return separated_along(u, v, pair);
}

}  // namespace wrenchd::simd
