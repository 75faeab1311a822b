// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "config/toml_reader.hpp"

namespace wrenchd {

/// Bytes as people write them, and what is wrong with them.
struct ReportBytes {
  std::vector<std::uint8_t> bytes;
  std::size_t error_index = 0;  ///< which byte of the text cannot be read, from 0
  std::string_view error;       ///< empty: none
};

/// "01 a0 FF", "01a0ff", "0x01,0xa0": pairs of hexadecimal digits, parted by nothing, blanks, commas or
/// colons, each with or without 0x.
ReportBytes parse_bytes(std::string_view text);

/// The bytes of a report as a text; refused where they are not, or are none, or more than a report holds.
bool read_bytes(const TomlValue& value, std::vector<std::uint8_t>& out);

}  // namespace wrenchd
