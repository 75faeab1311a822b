// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/pose.hpp"

namespace wrenchd {

/// Velocity of a body: linear velocity of a given point and angular velocity, in given axes. V_WB: twist of
/// B's origin relative to W, expressed in W.
struct Twist {
  Vector3d linear_m_per_s = Vector3d::Zero();
  Vector3d angular_rad_per_s = Vector3d::Zero();
};

/// Force and torque about a given point, in given axes.
struct Wrench {
  Vector3d force_N = Vector3d::Zero();
  Vector3d torque_Nm = Vector3d::Zero();
};

inline Wrench operator+(const Wrench& a, const Wrench& b) noexcept {
  return {a.force_N + b.force_N, a.torque_Nm + b.torque_Nm};
}
inline Wrench operator-(const Wrench& a, const Wrench& b) noexcept {
  return {a.force_N - b.force_N, a.torque_Nm - b.torque_Nm};
}
inline Wrench operator*(double s, const Wrench& F) noexcept {
  return {s * F.force_N, s * F.torque_Nm};
}

/// The wrench about another point, METHOD (5). p_old_new: vector from the old point to the new point, in the
/// wrench's axes [m]. RT-safe.
///
///   tau_new = tau_old - p_old_new x f
inline Wrench shifted(const Wrench& F, const Vector3d& p_old_new) noexcept {
  return {F.force_N, F.torque_Nm - p_old_new.cross(F.force_N)};
}

/// The wrench in other axes. R_AB rotates axes of B to axes of A. RT-safe.
inline Wrench expressed(const Quaterniond& R_AB, const Wrench& F_B) noexcept {
  return {R_AB * F_B.force_N, R_AB * F_B.torque_Nm};
}

/// The twist of another point of the body, METHOD (5). p_old_new: vector from the old point to the new point,
/// in the twist's axes [m]. RT-safe.
inline Twist shifted(const Twist& V, const Vector3d& p_old_new) noexcept {
  return {V.linear_m_per_s + V.angular_rad_per_s.cross(p_old_new), V.angular_rad_per_s};
}

inline Twist expressed(const Quaterniond& R_AB, const Twist& V_B) noexcept {
  return {R_AB * V_B.linear_m_per_s, R_AB * V_B.angular_rad_per_s};
}

}  // namespace wrenchd
