// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <string>

#include "core/device_profile.hpp"

namespace wrenchd {

/// Returns the udev rules that let the service use the devices of these profiles, as the text of a rules
/// file:
///
///   - The node that the profile's transport uses belongs to the group "wrenchd" exclusively, because hidraw
///     and usbfs have no exclusive access: any program that opens the node could apply force beyond all
///     limits. Rules of other packages continue to apply to devices without motors.
///   - The device is not suspended between two reports.
///   - The device moves no pointer, even if its usage page makes the kernel create an input device.
///   - Connecting the device starts the service, unless its profile requires explicit selection.
///
/// The rules have one block per id, sorted. The first lines name the version that created them. Throws
/// std::invalid_argument if the name of a profile is not is_profile_name(). Not RT-safe: allocates.
std::string udev_rules(std::span<const DeviceProfile> profiles);

}  // namespace wrenchd
