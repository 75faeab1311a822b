// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/device_profile.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// Describes the bytes of a device report, one line per field: name, SI values, unit and counts. wrenchd's
/// interpretation in the base frame follows. Tries the input reports first and the wrench report last; if
/// `to_device` is true, only the wrench report. Accepts the leading bytes that host libraries or FTDI chips
/// add. Throws std::runtime_error with the reason why no report of the profile matches. Not RT-safe:
/// allocates.
std::string report_text(const DeviceProfile& profile, std::span<const std::uint8_t> bytes,
                        bool to_device = false);

/// A wrench in the format of a device.
struct EncodedWrench {
  std::vector<std::uint8_t> bytes;  ///< report as transmitted
  /// Warnings about clamped or dropped components, and the assumed handle pose.
  std::vector<std::string> remarks;
};

/// Encodes a wrench on the hand about the handle point, in base axes. For a device with joints the motor
/// efforts depend on the pose: `at` is a report with that pose; if empty, the home pose applies. sequence:
/// number of the command, for devices that count commands. Throws std::runtime_error if the device accepts no
/// wrench, or if `at` is not a report of it. Not RT-safe: allocates.
EncodedWrench encode_wrench(const DeviceProfile& profile, const Wrench& F,
                            std::span<const std::uint8_t> at = {}, std::uint64_t sequence = 1);

/// Returns bytes as "01 a0 ff".
std::string hex_text(std::span<const std::uint8_t> bytes);

}  // namespace wrenchd
