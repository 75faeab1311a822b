// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <utility>

#include "config/device_file.hpp"

namespace wrenchd {

/// A device and the profile with which it was tested.
struct TestedDevice {
  std::string profile, serial;
  std::string profile_text;  ///< text of all files of the profile; another text needs another test
};

/// The devices that have passed the test before their first arming, on disk: a file per device. Not RT-safe:
/// accesses files.
class TestedDevices {
 public:
  explicit TestedDevices(std::filesystem::path directory = state_directory() / "tested")
      : directory_(std::move(directory)) {}

  /// Returns true if the device has passed the test with this text of its profile. Returns false if its file
  /// is absent, damaged or unreadable, and for a device without a serial number. Throws nothing.
  bool contains(const TestedDevice& device) const;

  /// Throws std::runtime_error with the remedy if the file cannot be written, and std::invalid_argument if
  /// the device has no serial number.
  void add(const TestedDevice& device) const;

 private:
  std::filesystem::path directory_;
};

}  // namespace wrenchd
