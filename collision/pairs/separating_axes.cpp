// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/pairs/separating_axes.hpp"

#include <algorithm>

#include "collision/pairs/bvh_traversal.hpp"
#include "collision/pairs/single_precision.hpp"

namespace wrenchd {

SeparatingAxes::SeparatingAxes(simd::AxesKernel kernel)
    : kernel_(kernel != nullptr  ? kernel
              : simd::has_avx2() ? simd::separated_avx2
                                 : simd::separated_portable) {}

bool SeparatingAxes::separated(const Triangle& a_start, const Triangle& a_end, const Triangle& b,
                               double margin_m) const noexcept {
  const Vector3d& origin = b[0];
  const Vector3d b1 = b[1] - origin, b2 = b[2] - origin;
  Triangle start, end;
  double extent_m = std::max(b1.lpNorm<Eigen::Infinity>(), b2.lpNorm<Eigen::Infinity>());
  for (std::size_t k = 0; k < 3; ++k) {
    start[k] = a_start[k] - origin;
    end[k] = a_end[k] - origin;
    extent_m = std::max({extent_m, start[k].lpNorm<Eigen::Infinity>(), end[k].lpNorm<Eigen::Infinity>()});
  }
  if (!(extent_m > 0.0)) return false;
  const double scale = 1.0 / extent_m;
  simd::AxesTriangles pair;
  for (int d = 0; d < 3; ++d) {
    for (std::size_t k = 0; k < 3; ++k) {
      pair.a[0][k][d] = static_cast<float>(scale * start[k][d]);
      pair.a[1][k][d] = static_cast<float>(scale * end[k][d]);
    }
    pair.b[0][d] = 0.0F;
    pair.b[1][d] = static_cast<float>(scale * b1[d]);
    pair.b[2][d] = static_cast<float>(scale * b2[d]);
  }
  pair.margin = static_cast<float>(scale * margin_m + simd::kRounding);
  return kernel_(pair);
}

}  // namespace wrenchd
