// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <string>

#include "core/device_profile.hpp"

namespace wrenchd {

/// The udev rules that let the service use the devices of these profiles, as the text of a rules file:
///
///   - the node that a profile's transport needs belongs to the group "wrenchd", and to nobody else. hidraw
///   and
///     usbfs know no exclusive use: whoever else may open a node may push the hand past all limits. What
///     drives nothing keeps the people that other rules let in;
///   - a device does not fall asleep between two reports;
///   - no pointer moves with it, where its usage page would have the kernel make an input device of it;
///   - plugging it in starts the service, unless its profile is for those only who name it.
///
/// One block for each id, sorted. The first lines name the version they were made by.
std::string udev_rules(std::span<const DeviceProfile> profiles);

}  // namespace wrenchd
