// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/run_context.hpp"

#include "daemon/servo/servo_loop.hpp"

namespace wrenchd {

bool RunContext::stop_requested() const noexcept {
  return signals.stop_requested() || (two_hands != nullptr && two_hands->failed.load());
}

void RunContext::start_deadline(Fault fault) const noexcept {
  if (two_hands == nullptr) return deadline.start(exit_code(fault));
  if (fault != Fault::none) two_hands->faulty.store(true);
  if (two_hands->running_hands.fetch_sub(1) == 1)
    deadline.start(two_hands->faulty.load() ? kExitFault : exit_code(Fault::none));
}

Fault latched_fault(const ServoLoop& loop) {
  return is_latched(loop.telemetry().state()) ? loop.telemetry().cause() : Fault::none;
}

}  // namespace wrenchd
