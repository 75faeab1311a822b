// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/device_run.hpp"

#include <spdlog/spdlog.h>

#include "daemon/device_start.hpp"
#include "daemon/wall_time_run.hpp"

namespace wrenchd {

Fault run_with_device(Runtime& runtime, const RunContext& context, const ReconnectingLink& link,
                      TimePoint end, WallClock& clock, LiveView& view) {
  const StopCondition stop = [&] { return context.stop_requested() || clock.now() >= end; };
  const ReportWaiting waiting = [&](const std::string& reason) {
    context.service.waiting(reason, context.hand);
  };
  const DeviceProfile& profile = runtime.config().profile;
  DeviceWait wait;
  for (bool at_start = true;; at_start = false) {
    if (!open_device(runtime, wait, at_start, stop, waiting)) return Fault::none;
    const UsbDevice& device = link.device().value();
    if (at_start) log_device(profile, device);
    if (at_start) log_missing_motors(profile);
    if (!at_start) spdlog::info("the device is connected again, and is disarmed: {}", describe(device));
    const std::string not_armed = apply_calibration(runtime, device, CalibrationStore());
    if (!not_armed.empty()) spdlog::warn("the device cannot be armed: {}", not_armed);
    if (!wait_for_rest_pose(runtime, clock, stop, waiting)) {
      runtime.close();
      if (stop()) return Fault::none;
      continue;
    }
    ScheduledRequests requests(context.options.arm && at_start && not_armed.empty(), {}, clock.now());
    const Fault fault = run_in_wall_time(runtime, context, profile.name + ", " + describe(device), end, clock,
                                         view, requests);
    if (fault == Fault::device_lost) waiting("the device was unplugged");
    runtime.close();
    if (fault != Fault::device_lost) return fault;
  }
}

}  // namespace wrenchd
