// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/device_profile.hpp"
#include "devices/report_descriptor.hpp"

namespace wrenchd {

/// The bytes of a report descriptor, and the known properties of its device.
struct DescriptorSource {
  std::vector<std::uint8_t> bytes;
  std::string file;    ///< path of the file that contains the descriptor
  std::string device;  ///< 'usb 046d:c626, "SpaceNavigator"', if the kernel knows the device; otherwise empty
  std::optional<UsbId> id{};  ///< vendor and product, if the kernel knows the device
};

/// Reads a descriptor from /dev/hidrawN, which asks the kernel, or from a file. The file contains the bytes
/// themselves, as /sys/class/hidraw/hidrawN/device/report_descriptor, or hexadecimal text. Throws
/// std::runtime_error with the file, the location in it and the remedy. Not RT-safe: reads a file.
DescriptorSource read_descriptor_source(const std::filesystem::path& file);

/// Calls parse_report_descriptor() and adds the source to its error message. Throws std::runtime_error. Not
/// RT-safe: allocates.
ReportDescriptor parse_descriptor(const DescriptorSource& source);

/// Parses "05 01 09 08", "0x05, 0x01," or "05010908", with comments from # or // to the end of a line. Throws
/// std::runtime_error whose message begins with LINE:COLUMN. Not RT-safe: allocates.
std::vector<std::uint8_t> parse_hex_text(std::string_view text);

}  // namespace wrenchd
