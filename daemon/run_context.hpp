// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>
#include <string>

#include "core/fault.hpp"
#include "daemon/options.hpp"
#include "daemon/process_signals.hpp"
#include "daemon/service_notify.hpp"
#include "daemon/stop_deadline.hpp"

namespace wrenchd {

class ServoLoop;

/// What every part of a run needs from the process. All members outlive the run.
struct RunContext {
  const Options& options;
  const ProcessSignals& signals;
  ServiceNotify& service;
  StopDeadline& deadline;
};

/// Time between two samples of the live view, two checks of the real-time state and two pumps of the
/// recorder.
inline constexpr auto kSamplePeriod = std::chrono::milliseconds(100);

/// Returns the fault that latched the loop; Fault::none in every other state.
Fault latched_fault(const ServoLoop& loop);

}  // namespace wrenchd
