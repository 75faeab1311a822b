// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

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

/// One of two hands in virtual time.
struct VirtualHand {
  Runtime& runtime;
  Recordings& recordings;
  LiveView& view;
  ScheduledRequests& requests;
  const RunContext& context;
  bool unplugged = false;
};

/// As run_in_virtual_time() for two hands: the second loop ticks half a period after the first one. A device
/// that a script unplugs is opened again while the other hand goes on. Returns the fault of each hand.
std::array<Fault, 2> run_two_in_virtual_time(std::array<VirtualHand, 2>& hands, TimePoint end,
                                             VirtualClock& clock);

}  // namespace wrenchd
