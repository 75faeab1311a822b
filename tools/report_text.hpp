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

/// The bytes of one report of a device in words, a field a line: name, SI values, unit, and the counts they
/// are made of; then what wrenchd makes of them, in the axes of the base. Reports from the device are tried
/// first, the wrench report last; `to_device` asks for the wrench report alone. Bytes that a host library or
/// an FTDI chip puts before a report may stand there. Throws std::runtime_error that says of every report of
/// the profile why the bytes are not it.
std::string report_text(const DeviceProfile& profile, std::span<const std::uint8_t> bytes,
                        bool to_device = false);

/// What a wrench becomes on its way to a device.
struct EncodedWrench {
  std::vector<std::uint8_t> bytes;   ///< as the wire has them
  std::vector<std::string> remarks;  ///< what was cut or dropped, and where the hand was taken to be
};

/// The bytes wrenchd writes for a wrench on the hand about the handle point, in axes of the base. The motors
/// of a device with joints need more or less for it at each place: `at` is a report of the device, from which
/// the place is read; empty: its home position. sequence: of the command, where the device counts them.
/// Throws std::runtime_error where the device takes no wrench, or `at` is no report of it.
EncodedWrench encode_wrench(const DeviceProfile& profile, const Wrench& F,
                            std::span<const std::uint8_t> at = {}, std::uint64_t sequence = 1);

/// "01 a0 ff"
std::string hex_text(std::span<const std::uint8_t> bytes);

}  // namespace wrenchd
