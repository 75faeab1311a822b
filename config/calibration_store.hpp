// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "config/config_error.hpp"
#include "core/calibration.hpp"

namespace wrenchd {

/// Where wrenchd keeps what it has learnt: the first of $STATE_DIRECTORY, which systemd sets, else
/// /var/lib/wrenchd.
std::filesystem::path state_directory();

/// Calibrations on disk, one small TOML file for each device, that people can read:
///
///   # wrenchd calibration 1
///   profile = "polhem"
///   serial = "A-0017"
///   [[offset]]
///   axis = "joint_1"
///   value = 0.0125
///   # crc32 5f0c2a91
///
/// A file is written whole or not at all: beside its place, to the disk, then put there. It is read whole or
/// not at all: one changed, missing or added byte anywhere is found by the last line, which is a checksum of
/// all lines before it. To change one by hand is therefore not possible; calibrate again. Not RT safe.
class CalibrationStore {
 public:
  explicit CalibrationStore(std::filesystem::path directory = state_directory() / "calibration")
      : directory_(std::move(directory)) {}

  /// Nothing where this device was never calibrated. Throws ConfigError, with the cure, where there is a file
  /// that is damaged, of another format, or of another device, or cannot be read.
  std::optional<Calibration> read(const std::string& profile, const std::string& serial) const;

  /// Replaces what was there, and makes the directory where it is missing. Throws std::runtime_error, with
  /// the cure, where it cannot be written; what was there is then as it was. Throws std::invalid_argument for
  /// a calibration that could not be read back: no serial number, two offsets for an axis, an offset that is
  /// no number. A crash on the way leaves the old file or the new one, and at worst a hidden .part file
  /// beside it.
  void write(const Calibration& calibration) const;

  /// "PROFILE@SERIAL.toml" in the directory. Bytes of either that are not letters, digits, _, - or a dot
  /// inside are written as % and two digits, so that no name leads out of the directory or means another's.
  /// Throws std::invalid_argument where one is empty, or both together are too long for a file name.
  std::filesystem::path file_of(std::string_view profile, std::string_view serial) const;

 private:
  std::filesystem::path directory_;
};

/// The text of a calibration's file, and back. `file` is for messages. Profile and serial number come back as
/// the file has them, as in its name (file_of). The second throws ConfigError.
std::string to_text(const Calibration& calibration);
Calibration parse_calibration(const std::string& text, const std::filesystem::path& file);

}  // namespace wrenchd
