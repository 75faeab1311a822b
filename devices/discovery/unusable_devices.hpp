// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string_view>

#include "core/device_profile.hpp"

namespace wrenchd {

/// A device that wrenchd knows and cannot use, and why.
struct UnusableDevice {
  std::uint16_t vendor = 0;
  std::uint16_t first_product = 0;  ///< both ends of a range belong to it
  std::uint16_t last_product = 0;
  std::string_view name;
  std::string_view reason;  ///< a sentence, with the way out where there is one
};

/// The entry for this id, or nullptr: nothing speaks against it. Such a device is never opened, whatever a
/// profile says.
const UnusableDevice* find_unusable_device(UsbId id) noexcept;

}  // namespace wrenchd
