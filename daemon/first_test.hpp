// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <string>

#include "config/tested_devices.hpp"
#include "daemon/device_start.hpp"
#include "daemon/run_config.hpp"
#include "devices/discovery/usb_devices.hpp"
#include "devices/links/report_link.hpp"
#include "devices/profile_device.hpp"

namespace wrenchd {

// The test of a device before it is armed for the first time. A device with the open report layout is tested
// while it is closed, by the rules of its layout: run_first_test(). Any other device is tested while it is
// open and homed, by pulses alone: run_direction_test(). A device is tested with a profile until it has
// passed; a device that is not on USB has no serial number and is tested at each start.

/// Returns true if the device must pass run_first_test() before it is armed: the configuration asks for it,
/// the device has motors and the open report layout, and it has not passed with this profile before. device:
/// null for a device that is not on USB. Not RT-safe: reads a file.
bool needs_first_test(const RunConfig& config, const UsbDevice* device, const TestedDevices& tested);
/// Returns true if the device must pass run_direction_test() before it is armed: as needs_first_test(), for
/// all other report layouts. Not RT-safe: reads a file.
bool needs_direction_test(const RunConfig& config, const UsbDevice* device, const TestedDevices& tested);

/// Reason why a device cannot be armed while it is homed or tested.
inline constexpr const char* kTestRuns =
    "it is being homed or tested; follow the instructions in the log, then try again";

/// Tests a device of the open report layout: check_conformance() without a moving hand. If a rule fails, the
/// test runs a second time, because a delay of this machine can spoil a test; a rule that fails in the first
/// test and does not pass in the second is broken. Logs each broken rule, and each rule that the test could
/// not judge. Stores in `tested` that a device passed if the test saw the direction of its force and torque.
/// Returns why the device must not be armed, with the remedy; "" if the device may be armed; nothing if
/// `stop` ended the test. Precondition: the link is closed; it is closed afterwards. An error of the device
/// is returned, not thrown. Not RT-safe: takes seconds.
std::optional<std::string> run_first_test(const RunConfig& config, ReportLink& link, const UsbDevice* device,
                                          Clock& clock, const StopCondition& stop,
                                          const ReportWaiting& waiting, const TestedDevices& tested);

/// Tests a device of any other report layout: check_directions(), with the same second test, log and store as
/// run_first_test(). Waits without limit for a person to home a device that is not homed. Returns nothing if
/// the device was lost or `stop` ended the test. Precondition: the device is open, and has been moved to its
/// reference pose if its profile requires that; it stays open. Not RT-safe: takes seconds.
std::optional<std::string> run_direction_test(const RunConfig& config, ProfileDevice& device,
                                              const UsbDevice* usb_device, Clock& clock,
                                              const StopCondition& stop, const ReportWaiting& waiting,
                                              const TestedDevices& tested);

}  // namespace wrenchd
