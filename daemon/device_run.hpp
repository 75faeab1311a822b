// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "daemon/live_view.hpp"
#include "daemon/run_context.hpp"
#include "daemon/runtime.hpp"
#include "daemon/wall_clock.hpp"
#include "devices/links/reconnecting_link.hpp"

namespace wrenchd {

/// Runs the servo loop with a real device. Waits for the device, and waits again after each unplugging; a
/// device that returns is disarmed. Returns the fault that ended the run, else Fault::none. Throws if the
/// device cannot be used at the start. Not RT-safe: returns when the run is over.
Fault run_with_device(Runtime& runtime, const RunContext& context, ReconnectingLink& link, TimePoint end,
                      WallClock& clock, LiveView& view);

}  // namespace wrenchd
