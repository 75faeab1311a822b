// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "daemon/live_view.hpp"
#include "daemon/run_context.hpp"
#include "daemon/runtime.hpp"
#include "daemon/scheduled_requests.hpp"
#include "daemon/wall_clock.hpp"

namespace wrenchd {

/// Runs the servo loop on a real-time thread, its own or that of two hands, until `end`, a signal or a fault
/// that ends the loop. Meanwhile the calling thread sends the requests, updates the live view and watches the
/// real-time state.
///
/// device: name for the service manager. Returns the fault that ended or latched the loop, else Fault::none.
/// Throws RealtimeError if real time is required and the kernel denies it. Not RT-safe: returns when the run
/// is over.
Fault run_in_wall_time(Runtime& runtime, const RunContext& context, const std::string& device, TimePoint end,
                       WallClock& clock, LiveView& view, ScheduledRequests& requests);

}  // namespace wrenchd
