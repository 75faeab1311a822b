// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/device_run.hpp"

#include <optional>
#include <stdexcept>

#include <spdlog/spdlog.h>

#include "daemon/device_start.hpp"
#include "daemon/first_test.hpp"
#include "daemon/wall_time_run.hpp"

namespace wrenchd {
namespace {

/// Returns why the opened device must not be armed, with the remedy; "" if the device may be armed. Tests a
/// device that needs its first test, and opens it again; returns nothing if `stop` ended the test, or if the
/// device cannot be opened again.
std::optional<std::string> find_obstacle(Runtime& runtime, ReconnectingLink& link, WallClock& clock,
                                         const StopCondition& stop, const ReportWaiting& waiting) {
  const UsbDevice device = link.device().value();
  const std::string not_calibrated = apply_calibration(runtime, device, CalibrationStore());
  const TestedDevices tested;
  if (!not_calibrated.empty() || !needs_first_test(runtime.config(), &device, tested)) return not_calibrated;
  runtime.close();
  std::optional<std::string> obstacle =
      run_first_test(runtime.config(), link, &device, clock, stop, waiting, tested);
  try {
    runtime.open();
  } catch (const std::runtime_error&) {
    return {};
  }
  return obstacle;
}

/// Tests the opened and homed device by pulses, if it needs that. Returns as run_direction_test().
std::optional<std::string> test_directions(Runtime& runtime, const UsbDevice& device, Clock& clock,
                                           const StopCondition& stop, const ReportWaiting& waiting) {
  const TestedDevices tested;
  if (!needs_direction_test(runtime.config(), &device, tested)) return std::string();
  return run_direction_test(runtime.config(), runtime.device(), &device, clock, stop, waiting, tested);
}

}  // namespace

Fault run_with_device(Runtime& runtime, const RunContext& context, ReconnectingLink& link, TimePoint end,
                      WallClock& clock, LiveView& view) {
  const StopCondition stop = [&] { return context.stop_requested() || clock.now() >= end; };
  const ReportWaiting waiting = [&](const std::string& reason) {
    context.service.waiting(reason, context.hand);
  };
  const DeviceProfile& profile = runtime.config().profile;
  DeviceWait wait;
  for (bool at_start = true;; at_start = false) {
    if (!open_device(runtime, wait, at_start, stop, waiting)) return Fault::none;
    const UsbDevice device = link.device().value();
    if (at_start) log_device(profile, device);
    if (at_start) log_missing_motors(profile);
    if (!at_start) spdlog::info("the device is connected again, and is disarmed: {}", describe(device));
    runtime.set_arming_obstacle(kTestRuns);
    std::optional<std::string> obstacle = find_obstacle(runtime, link, clock, stop, waiting);
    if (!obstacle && stop()) return Fault::none;
    if (!obstacle) continue;
    if (wait_for_rest_pose(runtime, clock, stop, waiting)) {
      if (obstacle->empty()) obstacle = test_directions(runtime, device, clock, stop, waiting);
    } else {
      obstacle.reset();
    }
    if (!obstacle) {
      runtime.close();
      if (stop()) return Fault::none;
      spdlog::warn("the device was disconnected before it was ready; waiting for it");
      waiting("the device was unplugged");
      continue;
    }
    if (!obstacle->empty()) spdlog::warn("the device cannot be armed: {}", *obstacle);
    runtime.set_arming_obstacle(*obstacle);
    ScheduledRequests requests(context.options.arm && at_start && obstacle->empty(), {}, clock.now());
    const Fault fault = run_in_wall_time(runtime, context, profile.name + ", " + describe(device), end, clock,
                                         view, requests);
    if (fault == Fault::device_lost) waiting("the device was unplugged");
    runtime.close();
    if (fault != Fault::device_lost) return fault;
  }
}

}  // namespace wrenchd
