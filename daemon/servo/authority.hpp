// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/state.hpp"

namespace wrenchd {

/// What the supervisor lets the output stage and the device port do in one tick.
struct Authority {
  State state = State::disconnected;
  double scale = 0.0;      ///< Share of the demanded wrench that may go out, 0 to 1.
  bool send = false;       ///< False while the self-test keeps silent to see the device's watchdog trip.
  bool motors_on = false;  ///< True if the command enables the motors.
};

}  // namespace wrenchd
