// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "config/config_error.hpp"
#include "config/device_file.hpp"
#include "core/calibration.hpp"

namespace wrenchd {

/// Calibrations on disk: one small readable TOML file per device.
///
///   # wrenchd calibration 1
///   profile = "polhem"
///   serial = "A-0017"
///   [[offset]]
///   axis = "joint_1"
///   value = 0.0125
///   # crc32 5f0c2a91
///
/// Writes are atomic: to a temporary file, then a rename. The last line is a checksum of all lines before it;
/// a file with any changed, missing or added byte is rejected. Manual edits are not possible; calibrate
/// again. Not RT-safe: accesses files.
class CalibrationStore {
 public:
  explicit CalibrationStore(std::filesystem::path directory = state_directory() / "calibration")
      : directory_(std::move(directory)) {}

  /// The calibration of a device; empty if there is none. Throws ConfigError, with the remedy, if the file is
  /// damaged, has another format, belongs to another device or cannot be read.
  std::optional<Calibration> read(const std::string& profile, const std::string& serial) const;

  /// Writes a calibration and creates the directory if necessary. Throws std::runtime_error, with the remedy,
  /// if the file cannot be written; the old file then remains. Throws std::invalid_argument if the
  /// calibration has no serial number, two offsets for one axis, or an offset that is not finite. After a
  /// crash the old or the new file is present, and possibly a hidden .part file.
  void write(const Calibration& calibration) const;

  /// Returns the file of one device, as device_file() names it. Throws as device_file().
  std::filesystem::path file_of(std::string_view profile, std::string_view serial) const;

 private:
  std::filesystem::path directory_;
};

/// File text of a calibration, and the reverse. `file` is for messages. Profile and serial number use the
/// encoding of file_of(). parse_calibration() throws ConfigError.
std::string to_text(const Calibration& calibration);
Calibration parse_calibration(const std::string& text, const std::filesystem::path& file);

}  // namespace wrenchd
