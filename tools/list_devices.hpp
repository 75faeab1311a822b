// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <span>
#include <string>

#include "config/known_profiles.hpp"
#include "devices/discovery/usb_devices.hpp"

namespace wrenchd {

/// Returns why a node cannot be opened, with the remedy; empty if it can be opened. Tests replace the
/// default, open_error().
using OpenCheck = std::function<std::string(const UsbDevice& device, const std::string& node)>;

/// Describes the connected devices for the user. Devices with a matching profile, devices that a profile may
/// be meant for, known devices that wrenchd cannot use, and multi-axis controllers have a paragraph each:
/// port, access, profile, and the reason why each other profile does not match. Other devices have one line,
/// or a paragraph if `all` is true. Warnings about the profiles follow. Text from devices is made printable.
/// Opens no device. Not RT-safe: reads files.
std::string device_list(std::span<const UsbDevice> devices, const KnownProfiles& known, bool all,
                        const OpenCheck& why_not_open);

}  // namespace wrenchd
