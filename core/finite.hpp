// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <bit>
#include <cstdint>

#include "core/pose.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// True if x is neither infinite nor NaN. Tests the bits, so no compiler flag can remove the test, and no
/// arithmetic precedes it. RT-safe.
inline bool is_finite(double x) noexcept {
  constexpr std::uint64_t exponent = 0x7ff0'0000'0000'0000;
  return (std::bit_cast<std::uint64_t>(x) & exponent) != exponent;
}
inline bool is_finite(const Vector3d& v) noexcept {
  return is_finite(v.x()) && is_finite(v.y()) && is_finite(v.z());
}
inline bool is_finite(const Quaterniond& q) noexcept {
  return is_finite(q.w()) && is_finite(q.x()) && is_finite(q.y()) && is_finite(q.z());
}
inline bool is_finite(const Pose& X) noexcept {
  return is_finite(X.rotation) && is_finite(X.translation_m);
}
inline bool is_finite(const Twist& V) noexcept {
  return is_finite(V.linear_m_per_s) && is_finite(V.angular_rad_per_s);
}
inline bool is_finite(const Wrench& F) noexcept {
  return is_finite(F.force_N) && is_finite(F.torque_Nm);
}

}  // namespace wrenchd
