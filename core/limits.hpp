// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/spatial.hpp"

namespace wrenchd {

/// What the daemon's configuration says of limits. It may tighten a profile's limits, never loosen them.
struct LimitSettings {
  double max_force_N = 0.0;   ///< 0: the profile's own
  double max_torque_Nm = 0.0;
  double force_slew_N_per_s = 2000.0;  ///< growth only; towards zero is free
  double torque_slew_Nm_per_s = 50.0;
  double soft_start_s = 1.0;           ///< from armed to full authority
};

}  // namespace wrenchd
