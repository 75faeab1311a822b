// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/device_profile.hpp"

namespace wrenchd {

/// An in-report as the device's own descriptor has it.
struct InputReportSize {
  std::uint8_t id = 0;     ///< 0: the device uses no ids
  std::size_t length = 0;  ///< bytes, the id included where there is one
};

/// What can be known of a plugged-in device without speaking to it.
struct DeviceIdentity {
  UsbId id;
  std::string serial;   ///< empty: it has none
  std::string product;  ///< as it calls itself; for people only
  std::optional<std::uint16_t> usage_page;
  std::optional<std::uint16_t> usage;
  std::optional<unsigned> interface;           ///< of the device, which this is; where it is known
  std::vector<InputReportSize> input_reports;  ///< empty: the descriptor has not been read
};

/// Which profile a device has, and why not another.
struct MatchResult {
  std::optional<std::size_t> profile;  ///< index into the profiles
  std::string refusal;  ///< why none at all: a known device that cannot be used, or several profiles
  std::vector<std::string> rejections;  ///< one for each profile, in their order; empty for those that match
};

/// Tells which of the profiles is for this device. Of several that match, one that names the serial number
/// goes before one that does not, and one that names the id for itself before one that goes by the reports;
/// where two are left, neither is taken. The profile `named` by the configuration is alone in being asked,
/// and may be one that is only used when named. Not RT safe.
MatchResult match_profile(const DeviceIdentity& device, std::span<const DeviceProfile> profiles,
                          std::string_view named = {});

/// Whether the report holds anything that a pose is made of: a device without it is another device.
bool carries_pose(const PoseReportLayout& report) noexcept;

/// Vendor and product as "046d:c626".
std::string text(UsbId id);

}  // namespace wrenchd
