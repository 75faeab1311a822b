// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <string>

#include "devices/discovery/match_profile.hpp"
#include "devices/discovery/usb_devices.hpp"
#include "devices/report_descriptor.hpp"

namespace wrenchd {

/// A connected device and its report descriptor, for comparison with the profiles.
struct InspectedDevice {
  DeviceIdentity identity;
  std::optional<ReportDescriptor> descriptor;  ///< empty: the device is not HID, or its descriptor is invalid
  std::string descriptor_error;  ///< byte and reason of the error in the descriptor; empty if there is none
};

/// Reads the identity and the report descriptor of a device. If the descriptor is invalid, the result still
/// has ids, serial number and usage. Does not communicate with the device. Not RT-safe: allocates.
InspectedDevice inspect_device(const UsbDevice& device);

}  // namespace wrenchd
