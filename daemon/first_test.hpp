// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "config/tested_devices.hpp"
#include "daemon/device_start.hpp"
#include "daemon/run_config.hpp"
#include "devices/discovery/usb_devices.hpp"
#include "devices/links/report_link.hpp"

namespace wrenchd {

/// Returns true if the device must be tested before it is armed: the configuration asks for it, the device
/// has motors and the open report layout, and it has not passed with this profile before. device: null for a
/// device that is not on USB, which is tested at each start. Not RT-safe: reads a file.
bool needs_first_test(const RunConfig& config, const UsbDevice* device, const TestedDevices& tested);

/// Reason why a device cannot be armed while run_first_test() tests it.
inline constexpr const char* kTestRuns = "its first test runs; try again in some seconds";

/// Tests a device before it is armed for the first time: check_conformance() without a moving hand. If a rule
/// fails, the test runs a second time, because a delay of this machine can spoil a test; a rule that fails in
/// the first test and does not pass in the second is broken. Logs each broken rule, and each rule that the
/// test could not judge. Stores in `tested` that a device passed if the test saw the direction of its force
/// and torque. Returns why the device must not be armed, with the remedy; "" if the device may be armed.
/// Precondition: the link is closed; it is closed afterwards. An error of the device is returned, not thrown.
/// Not RT-safe: takes seconds.
std::string run_first_test(const RunConfig& config, ReportLink& link, const UsbDevice* device, Clock& clock,
                           const StopCondition& stop, const ReportWaiting& waiting,
                           const TestedDevices& tested);

}  // namespace wrenchd
