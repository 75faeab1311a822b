// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/run_context.hpp"

#include "daemon/servo/servo_loop.hpp"

namespace wrenchd {

Fault latched_fault(const ServoLoop& loop) {
  return is_latched(loop.telemetry().state()) ? loop.telemetry().cause() : Fault::none;
}

}  // namespace wrenchd
