// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/pose.hpp"

namespace wrenchd::test {

/// Returns the homogeneous 4 x 4 matrix of a pose.
inline Eigen::Matrix4d matrix(const Pose& X) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = X.rotation.toRotationMatrix();
  m.topRightCorner<3, 1>() = X.translation_m;
  return m;
}

}  // namespace wrenchd::test
