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

/// Tests a device before it is armed for the first time: check_conformance() without a moving hand, within
/// seconds. A rule counts as broken if it fails twice, because a delay of this machine can spoil one attempt.
/// Logs each broken rule, and what the test could not judge. Remembers a device whose force and torque have
/// been seen to be right. Returns why the device must not be armed, with the remedy; "" if it may.
/// Precondition: the link is closed; it is closed afterwards. Throws nothing that the device causes. Not
/// RT-safe: takes seconds.
std::string run_first_test(const RunConfig& config, ReportLink& link, const UsbDevice* device, Clock& clock,
                           const StopCondition& stop, const ReportWaiting& waiting,
                           const TestedDevices& tested);

}  // namespace wrenchd
