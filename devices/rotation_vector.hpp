// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/pose.hpp"

namespace wrenchd {

/// Rotation by |w| about w [rad]: the rotational half of exp(). RT safe.
inline Quaterniond rotation_from(const Vector3d& w) noexcept {
  Vector6d xi = Vector6d::Zero();
  xi.tail<3>() = w;
  return exp(xi).rotation;
}

/// Axis times angle of a rotation [rad], at most pi long: the rotational half of log(). RT safe.
inline Vector3d rotation_vector(const Quaterniond& R) noexcept {
  return log({R, Vector3d::Zero()}).tail<3>();
}

}  // namespace wrenchd
