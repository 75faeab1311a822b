// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/device_profile.hpp"
#include "devices/discovery/usb_devices.hpp"

namespace wrenchd {

/// Criteria by which the configuration selects a device.
struct DeviceCriteria {
  std::string profile = {};  ///< name of the profile; empty: any profile for a real device
  std::string serial = {};   ///< serial number of the device; empty: any
  /// USB port of the device, as UsbDevice::port_path; empty: any. For equal devices without serial numbers.
  std::string usb_port = {};
  /// The device that was driven and then unplugged: only this device is selected again.
  std::optional<UsbDevice> previous = {};
};

/// The selected device, and the reasons why the others are rejected.
struct DeviceChoice {
  struct Selection {
    std::size_t device = 0;   ///< index into the connected devices
    std::size_t profile = 0;  ///< index into the profiles
  };
  std::optional<Selection> selection;
  /// One entry per connected device, in their order: the reason for its rejection; empty for the selected
  /// device.
  std::vector<std::string> rejections;
};

/// Selects the one device that meets the criteria. The device must match one of the profiles
/// (match_profile()), have the requested serial number, port and interface, and have a report descriptor that
/// agrees with the profile. If several devices qualify, selects none, and each rejection states how to
/// distinguish the device. Opens no device. Not RT-safe: allocates.
DeviceChoice choose_device(std::span<const UsbDevice> connected, std::span<const DeviceProfile> profiles,
                           const DeviceCriteria& criteria);

}  // namespace wrenchd
