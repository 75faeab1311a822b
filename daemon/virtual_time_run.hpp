// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "daemon/live_view.hpp"
#include "daemon/recording/recordings.hpp"
#include "daemon/run_context.hpp"
#include "daemon/runtime.hpp"
#include "daemon/scheduled_requests.hpp"

namespace wrenchd {

/// Runs the servo loop on the calling thread in virtual time until `end`, a signal or the loss of the device.
/// Every run with the same input gives the same ticks. Releases the hand at the end. Returns the fault that
/// latched the loop or ended the run, else Fault::none. Not RT-safe: returns when the run is over.
Fault run_in_virtual_time(Runtime& runtime, const RunContext& context, Recordings& recordings, TimePoint end,
                          VirtualClock& clock, LiveView& view, ScheduledRequests& requests);

}  // namespace wrenchd
