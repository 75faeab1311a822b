// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <string>

#include "config/calibration_store.hpp"
#include "daemon/device_wait.hpp"
#include "daemon/runtime.hpp"

namespace wrenchd {

// The way of a real device from plugged in to ready, before its servo loop runs. Not RT safe.

/// When to stop for another reason than a fault.
using StopCondition = std::function<bool()>;
/// Is told that nothing can happen before something outside does, a device or a person, and what.
using ReportWaiting = std::function<void(const std::string& what)>;

/// Where the configuration leaves the profile to the device: that of the one device that has one, which is
/// waited for. False: it is time to stop.
bool choose_profile(RunConfig& plan, const StopCondition& stop, const ReportWaiting& waits);

/// Opens the station's device, and waits for it where it is not plugged in. False: it is time to stop. What
/// is wrong with a device that is there at the start is thrown; later it is logged, and waited for its cure.
bool open_device(Runtime& station, DeviceWait& wait, bool at_start, const StopCondition& stop,
                 const ReportWaiting& waits);

/// What the device is, said once.
void log_device(const DeviceProfile& profile, const UsbDevice& device);
/// What it has no motors for, said once: that is not felt.
void log_missing_motors(const DeviceProfile& profile);

/// Lets the opened device take over its stored calibration, where its profile asks for one. Returns why it
/// may not be armed, with the cure; empty: it may.
std::string calibrate(Runtime& station, const UsbDevice& device, const CalibrationStore& store);

/// Where the device counts from wherever it was switched on: has the person put the handle into its rest, and
/// says so in the log. False: the device was lost, or it is time to stop.
bool wait_for_rest_pose(Runtime& station, Clock& clock, const StopCondition& stop,
                        const ReportWaiting& waits);

}  // namespace wrenchd
