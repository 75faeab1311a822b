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

/// Length of an input report, from the device's report descriptor.
struct InputReportSize {
  std::uint8_t id = 0;     ///< report id; 0: the device has no report ids
  std::size_t length = 0;  ///< length in bytes, including the id if there is one
};

/// Identity of a connected device, known without communicating with it.
struct DeviceIdentity {
  UsbId id;
  std::string serial;   ///< serial number; empty: the device has none
  std::string product;  ///< product name, for display only
  std::optional<std::uint16_t> usage_page;
  std::optional<std::uint16_t> usage;
  std::optional<unsigned> interface;           ///< interface of the device, if known
  std::vector<InputReportSize> input_reports;  ///< empty: the descriptor has not been read
};

/// Matching profile of a device, and why the others do not match.
struct MatchResult {
  std::optional<std::size_t> profile;  ///< index into the profiles
  std::string rejection;  ///< why no profile is used: an unusable device, or several matching profiles
  /// One entry per profile, in their order: why it does not match; empty if it matches.
  std::vector<std::string> rejections;
};

/// Returns true if the profile names this id, or its vendor, among those that it matches, whatever else it
/// requires. Not RT-safe: lists of any length.
bool lists_id(const DeviceProfile& profile, UsbId id) noexcept;

/// Finds the profile of a device. If several match, a profile that names the serial number has priority, then
/// one that names the product string, then one that names the id in `usb` over one in `usb_by_layout`, and
/// the latter over one that names the vendor only. If two profiles have equal priority, no profile is used.
/// If the configuration names a profile (`named`), only that profile is considered, even if it is marked
/// only_when_named.
///
/// wrenchd may write to a device with motors only if it knows the device. Ids that many kinds of devices
/// share (shared_usb_ids.hpp) do not identify it, and a lock-step device must be written to before it sends
/// anything. Such a profile matches only if it names a serial number or a product string, or if the
/// configuration names the profile or the serial number of this device (`serial_named`). Exception: a device
/// that sends first and protects its reports by a checksum identifies itself, because wrenchd writes nothing
/// before it has received such reports. Not RT-safe: allocates.
MatchResult match_profile(const DeviceIdentity& device, std::span<const DeviceProfile> profiles,
                          std::string_view named = {}, bool serial_named = false);

/// Returns true if the report carries a part of the pose. A device without such a report does not match the
/// profile. RT-safe.
bool carries_pose(const PoseReportLayout& report) noexcept;

/// Returns vendor and product id as "046d:c626". Not RT-safe: allocates.
std::string text(UsbId id);

}  // namespace wrenchd
