// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <string>

#include "config/calibration_store.hpp"
#include "daemon/device_wait.hpp"
#include "daemon/run_context.hpp"
#include "daemon/runtime.hpp"

namespace wrenchd {

// The steps that take a real device from plugged in to ready, before its servo loop runs. Not RT-safe: each
// function may wait for a device or a person without limit, unless stated otherwise.

/// Returns true when waiting must end although the condition is not met.
using StopCondition = std::function<bool()>;
/// Receives the reason why the daemon waits for a device or a person.
using ReportWaiting = std::function<void(const std::string& reason)>;

/// Waits for exactly one connected device that has a profile, and stores that profile in `config`. Call it if
/// the configuration names no profile. Returns false if `stop` ended the waiting.
bool choose_profile(RunConfig& config, const StopCondition& stop, const ReportWaiting& waiting);

/// Opens the device of the runtime, and waits for the device if it is not connected. Returns false if `stop`
/// ended the waiting. at_start: throws std::runtime_error if the first attempt finds the device but cannot
/// use it. Otherwise logs such an error and tries again.
bool open_device(Runtime& runtime, DeviceWait& wait, bool at_start, const StopCondition& stop,
                 const ReportWaiting& waiting);

/// Opens a simulated device again. Returns false as long as its script keeps it unplugged. Does not wait.
bool open_again(Runtime& runtime);
/// Logs, and tells the service manager, that the simulated device of this hand was unplugged. Does not wait.
void log_unplugged(const RunContext& context);

/// Logs identity, transport, sensed and driven degrees of freedom of the device. Does not wait.
void log_device(const DeviceProfile& profile, const UsbDevice& device);
/// Logs which components of the wrench the device cannot exert. Does not wait.
void log_missing_motors(const DeviceProfile& profile);

/// Applies the stored calibration to the opened device, if its profile requires one. Returns the reason why
/// the device must not be armed, with the cure; an empty text allows arming. Does not wait.
std::string apply_calibration(Runtime& runtime, const UsbDevice& device, const CalibrationStore& store);

/// If the encoders of the device count from the pose at power-up: waits until the operator has put the handle
/// into its reference pose, and logs the instructions. Returns false if the device was lost or `stop` ended
/// the waiting.
bool wait_for_rest_pose(Runtime& runtime, Clock& clock, const StopCondition& stop,
                        const ReportWaiting& waiting);

}  // namespace wrenchd
