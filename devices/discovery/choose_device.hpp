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

/// The device that is to be driven, as far as it is settled.
struct DeviceCriteria {
  std::string profile = {};                ///< its name; empty: any that is for a device
  std::string serial = {};                 ///< empty: any
  std::optional<UsbDevice> previous = {};  ///< the one that was driven, and was unplugged: no other will do
};

/// Which of the plugged-in devices it is, and why the others are not.
struct DeviceChoice {
  struct Selection {
    std::size_t device = 0;   ///< index into the plugged-in ones
    std::size_t profile = 0;  ///< index into the profiles
  };
  std::optional<Selection> selection;
  /// One for each plugged-in device, in their order; empty for the one that was picked.
  std::vector<std::string> rejections;
};

/// Picks the one device that is wanted. A device has to have one of the profiles (match_profile()), to be the
/// serial number and the interface that is asked for, and its own report descriptor has to agree with the
/// profile. Of several such devices none is picked, and each is told what tells it from the others. Not RT
/// safe; speaks to no device.
DeviceChoice choose_device(std::span<const UsbDevice> plugged, std::span<const DeviceProfile> profiles,
                           const DeviceCriteria& wanted);

}  // namespace wrenchd
