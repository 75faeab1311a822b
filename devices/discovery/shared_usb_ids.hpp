// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string_view>

#include "core/device_profile.hpp"

namespace wrenchd {

/// Ids that many kinds of devices share: they say nothing about what a device does with the bytes it
/// receives.
struct SharedUsbIds {
  std::uint16_t vendor = 0;
  std::uint16_t first_product = 0;  ///< range of product ids, both ends included
  std::uint16_t last_product = 0;
  std::string_view users;  ///< which devices have these ids, in one phrase
};

/// Returns the entry of this id; nullptr if it is not known to be shared. Not RT-safe: intended for set-up.
const SharedUsbIds* find_shared_usb_id(UsbId id) noexcept;

}  // namespace wrenchd
