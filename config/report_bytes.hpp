// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "config/toml_reader.hpp"

namespace wrenchd {

/// Bytes parsed from a text, with the first error.
struct ReportBytes {
  std::vector<std::uint8_t> bytes;
  std::size_t error_index = 0;  ///< index of the first invalid byte in the text, from 0
  std::string_view error;       ///< description of the error; empty: none
};

/// Parses pairs of hexadecimal digits, separated by nothing, blanks, commas or colons, each with or without
/// 0x: "01 a0 FF", "01a0ff", "0x01,0xa0". Not RT-safe: allocates.
ReportBytes parse_bytes(std::string_view text);

/// Reads the bytes of a report from a text. Rejects an invalid or empty text and more bytes than a report
/// holds.
bool read_bytes(const TomlValue& value, std::vector<std::uint8_t>& out);

}  // namespace wrenchd
