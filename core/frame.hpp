// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/pose.hpp"

namespace wrenchd {

/// A pose with its rotation as a matrix: transforms many points faster than a quaternion. RT-safe.
struct Frame {
  Matrix3d R = Matrix3d::Identity();
  Vector3d x_m = Vector3d::Zero();

  Frame() = default;
  explicit Frame(const Pose& X) noexcept : R(X.rotation.toRotationMatrix()), x_m(X.translation_m) {}

  Vector3d operator*(const Vector3d& p_m) const noexcept { return R * p_m + x_m; }
  /// The inverse transformation of a point: R' (p - x).
  Vector3d inverse_transform(const Vector3d& p_m) const noexcept { return R.transpose() * (p_m - x_m); }
  /// This pose relative to another: inverse(other) * this.
  Frame relative_to(const Frame& other) const noexcept {
    Frame out;
    out.R = other.R.transpose() * R;
    out.x_m = other.inverse_transform(x_m);
    return out;
  }
};

}  // namespace wrenchd
