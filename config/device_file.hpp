// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace wrenchd {

// Files about single devices, such as a calibration: one small readable text per device, with a checksum in
// the last line. Not RT-safe: these functions access files.

/// Directory of wrenchd's persistent data: $STATE_DIRECTORY, which systemd sets; otherwise /var/lib/wrenchd.
std::filesystem::path state_directory();

/// Letters and digits of ASCII.
bool is_letter_or_digit(char c) noexcept;

/// Returns the text with bytes other than letters, digits, _, - and inner dots as % and two hexadecimal
/// digits. The result is valid as a file name and as a TOML string.
std::string encoded_device_name(std::string_view bytes);

/// "PROFILE@SERIAL.toml" in the directory, both encoded, so each device has its own file inside of the
/// directory. Throws std::invalid_argument, which begins with `kind`, if a part is empty or the name is too
/// long.
std::filesystem::path device_file(const std::filesystem::path& directory, std::string_view kind,
                                  std::string_view profile, std::string_view serial);

/// Returns the text and a last line with its checksum.
std::string with_checksum(const std::string& text);
/// True if the last line is the checksum of all lines before it.
bool has_valid_checksum(const std::string& text);

/// Returns the bytes of a file; nothing if it does not exist. Throws ConfigError if it cannot be read, is no
/// regular file, or is larger than 64 KiB. cure: end of the message about
/// a file that is not regular or too large.
std::optional<std::string> read_device_file(const std::filesystem::path& file, const std::string& cure);

/// Writes a file, and makes its directory if necessary: to a temporary file, then a rename. After a crash the
/// old or the new file is present, and possibly a hidden .part file. Throws std::runtime_error with the
/// remedy; the old file then remains.
void write_device_file(const std::filesystem::path& file, std::string_view text);

}  // namespace wrenchd
