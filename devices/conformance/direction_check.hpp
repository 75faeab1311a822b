// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <stdexcept>
#include <vector>

#include "core/clock.hpp"
#include "devices/conformance/rule_result.hpp"
#include "devices/profile_device.hpp"

namespace wrenchd {

/// Error: the device was disconnected during a check.
class DeviceDisconnected : public std::runtime_error {
 public:
  DeviceDisconnected() : std::runtime_error("the device was disconnected") {}
};

/// Checks what pulses can show of a device with any report layout (DirectionPulses): sign and axis of each
/// force and torque that the device both drives and senses, each velocity that it reports, and the sequences
/// of its reports and acknowledgements. Releases the device on every way out; it stays open.
///
/// Precondition: the device is open, homed, and has sent a valid pose. cancelled: returns true if the user
/// cancels; the check then throws SessionCancelled. Throws DeviceDisconnected, and std::runtime_error with
/// the fault if the device has one. Not RT-safe: takes one to three seconds.
std::vector<RuleResult> check_directions(ProfileDevice& device, Clock& clock,
                                         const std::function<bool()>& cancelled);

}  // namespace wrenchd
