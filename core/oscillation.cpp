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
  for (const Axis& axis : axes_) oscillates_ = oscillates_ || axis.half_cycles >= kMinHalfCycles;
}

/// A reversal counts if the handle has come back by min_amplitude_m; smaller motion is encoder noise.
void OscillationDetector::advance(Axis& axis, double step_m, double work_J, double dt_s,
                                  bool in_contact) const noexcept {
  axis.displacement_m += step_m;
  axis.time_s += dt_s;
  axis.work_J += std::abs(work_J);
  axis.had_contact = axis.had_contact || in_contact;
  const bool beyond =
      std::abs(axis.displacement_m) >= std::abs(axis.peak_m) && axis.displacement_m * axis.peak_m >= 0.0;
  if (beyond) {
    axis.peak_m = axis.displacement_m;
    axis.peak_time_s = axis.time_s;
  } else if (std::abs(axis.peak_m - axis.displacement_m) >= settings_.min_amplitude_m) {
    end_half_cycle(axis);
  }
}

void OscillationDetector::end_half_cycle(Axis& axis) const noexcept {
  const double swing_m = std::abs(axis.peak_m);
  const bool in_band =
      axis.peak_time_s >= 0.5 / kMaxFrequency_Hz && axis.peak_time_s <= 0.5 / kMinFrequency_Hz;
  const bool counts = in_band && axis.had_contact && swing_m >= kMinAmplitudeRatio * axis.last_amplitude_m &&
                      axis.work_J >= settings_.min_work_J;
  axis.half_cycles = counts ? axis.half_cycles + 1 : 0;
  axis.last_amplitude_m = swing_m;
  axis.displacement_m = axis.peak_m = axis.displacement_m - axis.peak_m;
  axis.time_s = axis.peak_time_s = axis.time_s - axis.peak_time_s;
  axis.work_J = 0.0;
  axis.had_contact = false;
}

}  // namespace wrenchd
