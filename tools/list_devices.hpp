// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <span>
#include <string>

#include "config/known_profiles.hpp"
#include "devices/discovery/usb_devices.hpp"

namespace wrenchd {

/// Why a node cannot be opened, and the cure; empty where it can. why_not_open(), where it is not a test that
/// asks.
using OpenCheck = std::function<std::string(const UsbDevice& device, const std::string& node)>;

/// What is plugged in, for a person. A paragraph for each device that a profile is for or might be meant for,
/// that wrenchd knows and cannot use, or that is a multi-axis controller: where it is, whether it can be
/// opened, its profile, and for every other profile why not. A line for each of the rest; with `all` they
/// have a paragraph too. Then what the profiles themselves want to be told of. What devices say of themselves
/// comes out as plain characters, whatever it is. Speaks to no device. Not RT safe.
std::string device_list(std::span<const UsbDevice> devices, const KnownProfiles& known, bool all,
                        const OpenCheck& why_not_open);

}  // namespace wrenchd
