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

/// A report descriptor as bytes, and what is known of the device it came from.
struct DescriptorSource {
  std::vector<std::uint8_t> bytes;
  std::string file;           ///< the file
  std::string device;         ///< 'usb 046d:c626, "SpaceNavigator"', where the kernel knows; otherwise empty
  std::optional<UsbId> id{};  ///< vendor and product, likewise
};

/// Reads a descriptor from /dev/hidrawN, where the kernel is asked, or from a file: the bytes themselves, as
/// in /sys/class/hidraw/hidrawN/device/report_descriptor, or hexadecimal text. Throws std::runtime_error that
/// names the file, the place in it and the cure.
DescriptorSource read_descriptor_source(const std::filesystem::path& file);

/// The same as parse_report_descriptor(), with the source in the message. Throws std::runtime_error.
ReportDescriptor parse_descriptor(const DescriptorSource& source);

/// "05 01 09 08", "0x05, 0x01," or "05010908", with comments from # or // to the end of a line. Throws
/// std::runtime_error that begins with LINE:COLUMN.
std::vector<std::uint8_t> parse_hex_text(std::string_view text);

}  // namespace wrenchd
