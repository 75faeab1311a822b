// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>

namespace wrenchd {

/// Returns v, scaled down to the norm max_norm if it is longer. RT-safe.
inline Eigen::Vector3d clamp_norm(const Eigen::Vector3d& v, double max_norm) noexcept {
  const double length = v.norm();
  return length > max_norm ? Eigen::Vector3d(v * (max_norm / length)) : v;
}

}  // namespace wrenchd
