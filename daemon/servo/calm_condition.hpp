// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

#include "core/state_machine.hpp"

namespace wrenchd {

/// What State::waiting waits for: a valid proxy, a slow handle, and a small contact wrench at full authority.
/// With the numbers that the condition compares, so that a text can name which of them keeps the force
/// away.
struct CalmCondition {
  bool proxy_valid = false;
  bool sampled = false;  ///< A usable sample of this device has arrived.
  double speed_m_per_s = 0.0;
  double angular_speed_rad_per_s = 0.0;
  double force_N = 0.0;  ///< Of the contacts, at full authority.
  double torque_Nm = 0.0;
  double max_force_N = 0.0;  ///< Largest force that the soft start may begin with.
  double max_torque_Nm = 0.0;
  /// Displacement of the handle that brings the tool to its proxy, where no contact pushes: in axes of the
  /// world [m].
  std::array<double, 3> to_proxy_W_m{};
  double to_proxy_rad = 0.0;  ///< Angle of the rotation that does.

  bool is_slow() const noexcept { return speed_m_per_s < kCalmSpeed_m_per_s; }
  bool turns_slowly() const noexcept { return angular_speed_rad_per_s < kCalmAngularSpeed_rad_per_s; }
  bool force_is_small() const noexcept { return force_N <= max_force_N; }
  bool torque_is_small() const noexcept { return torque_Nm <= max_torque_Nm; }
  /// RT-safe.
  bool holds() const noexcept {
    return proxy_valid && sampled && is_slow() && turns_slowly() && force_is_small() && torque_is_small();
  }
};

}  // namespace wrenchd
