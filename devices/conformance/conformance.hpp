// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "devices/conformance/rule_result.hpp"
#include "devices/discovery/usb_devices.hpp"
#include "devices/links/report_link.hpp"

namespace wrenchd {

struct ConformanceOptions {
  /// Longest time in which the user moves the handle; 0: the user is not asked, and only the motion by pulses
  /// judges the velocity.
  Duration motion_time = std::chrono::seconds(20);
  /// If false, no command contains a wrench other than zero.
  bool pulses = true;
  /// If true, the series of commands and the pulses are shorter, and there are fewer pulses.
  bool brief = false;
};

/// Callbacks to the user beside the device.
struct ConformanceUser {
  std::function<void(const std::string&)> instruct;  ///< shows the user the next instruction
  std::function<bool()> cancelled;                   ///< returns true if the user has cancelled
};

/// Checks the rules of devices/README.md for a device with the open report layout, in this order: it listens,
/// asks the user to move the handle, sends commands with zero wrench, and applies short pulses
/// (DirectionPulses). Nothing is written to
/// a device whose reports are not valid, and no pulse to a device without a working watchdog. The device is
/// released on every way out.
///
/// device: identity and report descriptor; null for a device that is not on USB. Throws std::runtime_error if
/// the profile has another report layout, if the link cannot be opened, if the device is disconnected, and if
/// the user cancels (SessionCancelled). Not RT-safe: takes some ten seconds.
std::vector<RuleResult> check_conformance(const DeviceProfile& profile, ReportLink& link,
                                          const UsbDevice* device, Clock& clock, const ConformanceUser& user,
                                          const ConformanceOptions& options = {});

/// Returns true if the reports of the profile are those of the open report layout, with or without the
/// velocities.
bool has_open_layout(const DeviceProfile& profile);

/// Throws std::runtime_error with the difference if the reports of the profile are not those of the open
/// report layout. The profile may leave out the velocities.
void require_open_layout(const DeviceProfile& profile);

}  // namespace wrenchd
