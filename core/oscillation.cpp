// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/oscillation.hpp"

#include <cmath>
#include <cstddef>

#include "core/finite.hpp"

namespace wrenchd {

void OscillationDetector::update(const Wrench& F_B, const Twist& V_BH, double dt_s,
                                 bool in_contact) noexcept {
  if (!(dt_s > 0.0) || !is_finite(dt_s) || !is_finite(F_B) || !is_finite(V_BH)) return;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    const double step_m = V_BH.linear_m_per_s[k] * dt_s, turn_rad = V_BH.angular_rad_per_s[k] * dt_s;
    advance(axes_[i], step_m, F_B.force_N[k] * step_m, dt_s, in_contact);
    advance(axes_[i + 3], settings_.lever_m * turn_rad, F_B.torque_Nm[k] * turn_rad, dt_s, in_contact);
  }
  for (const Axis& axis : axes_) oscillates_ = oscillates_ || axis.swings >= kSwings;
}

/// A turning point is one from which the handle has come back by way_m: smaller wiggles are an encoder's.
void OscillationDetector::advance(Axis& axis, double step_m, double work_J, double dt_s,
                                  bool in_contact) const noexcept {
  axis.way_m += step_m;
  axis.time_s += dt_s;
  axis.work_J += std::abs(work_J);
  axis.touched = axis.touched || in_contact;
  const bool beyond =
      std::abs(axis.way_m) >= std::abs(axis.farthest_m) && axis.way_m * axis.farthest_m >= 0.0;
  if (beyond) {
    axis.farthest_m = axis.way_m;
    axis.reached_s = axis.time_s;
  } else if (std::abs(axis.farthest_m - axis.way_m) >= settings_.way_m) {
    turn(axis);
  }
}

void OscillationDetector::turn(Axis& axis) const noexcept {
  const double swing_m = std::abs(axis.farthest_m);
  const bool in_band = axis.reached_s >= 0.5 / kMost_Hz && axis.reached_s <= 0.5 / kLeast_Hz;
  const bool counts =
      in_band && axis.touched && swing_m >= kKept * axis.last_swing_m && axis.work_J >= settings_.work_J;
  axis.swings = counts ? axis.swings + 1 : 0;
  axis.last_swing_m = swing_m;
  axis.way_m = axis.farthest_m = axis.way_m - axis.farthest_m;
  axis.time_s = axis.reached_s = axis.time_s - axis.reached_s;
  axis.work_J = 0.0;
  axis.touched = false;
}

}  // namespace wrenchd
