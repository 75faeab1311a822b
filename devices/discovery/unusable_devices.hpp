// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string_view>

#include "core/device_profile.hpp"

namespace wrenchd {

/// A device that wrenchd knows and cannot use, with the reason.
struct UnusableDevice {
  std::uint16_t vendor = 0;
  std::uint16_t first_product = 0;  ///< range of product ids, both ends included
  std::uint16_t last_product = 0;
  std::string_view name;
  std::string_view reason;  ///< one sentence, with an alternative if there is one
};

/// Returns the entry of this id; nullptr if the device may be used. wrenchd never opens a device with an
/// entry, whatever the profiles contain. Not RT-safe: intended for set-up.
const UnusableDevice* find_unusable_device(UsbId id) noexcept;

}  // namespace wrenchd
