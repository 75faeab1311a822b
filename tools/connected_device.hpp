// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "core/device_profile.hpp"
#include "devices/discovery/usb_devices.hpp"

namespace wrenchd {

/// A connected device and its profile.
struct ConnectedDevice {
  DeviceProfile profile;
  UsbDevice device;
};

/// Finds the connected device that a command line selects. profile: name or file of a profile, or "auto" for
/// any profile. serial: serial number; empty: any. hidraw_node: "/dev/hidraw3"; empty: any. Opens no device.
/// Throws std::runtime_error with the rejected devices and their reasons if no device, or more than one, is
/// selected, and if the profile is that of the simulated device. Not RT-safe: reads files.
ConnectedDevice find_connected_device(const std::string& profile, const std::string& serial,
                                      const std::string& hidraw_node = {});

}  // namespace wrenchd
