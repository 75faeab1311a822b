// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <string>

#include "devices/discovery/match_profile.hpp"
#include "devices/discovery/usb_devices.hpp"
#include "devices/report_descriptor.hpp"

namespace wrenchd {

/// What the system knows of a plugged-in device, read so that profiles can be held against it.
struct InspectedDevice {
  DeviceIdentity identity;
  std::optional<ReportDescriptor> descriptor;  ///< none: it is not HID, or what it says cannot be read
  std::string
      descriptor_error;  ///< the byte of the descriptor and what is wrong there; empty where all is well
};

/// Reads the device's report descriptor, with which something may be wrong: where it is refused the device
/// has its ids, serial number and usage still. Not RT safe; speaks to no device.
InspectedDevice inspect_device(const UsbDevice& device);

}  // namespace wrenchd
