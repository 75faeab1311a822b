// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/tested_devices.hpp"

#include <stdexcept>

namespace wrenchd {
namespace {

constexpr const char* kKind = "device test";

/// Returns the content of the file of a device. It contains the checksum of the profile text, not the text.
std::string content_of(const TestedDevice& device) {
  const std::string with_sum = with_checksum(device.profile_text);
  return with_checksum("# wrenchd device test 1\n# passed with the profile of\n" +
                       with_sum.substr(device.profile_text.size()));
}

}  // namespace

bool TestedDevices::contains(const TestedDevice& device) const {
  if (device.profile.empty() || device.serial.empty()) return false;
  try {
    return read_device_file(device_file(directory_, kKind, device.profile, device.serial), {}) ==
           content_of(device);
  } catch (const std::exception&) {
    return false;  // wrenchd then tests the device again
  }
}

void TestedDevices::add(const TestedDevice& device) const {
  write_device_file(device_file(directory_, kKind, device.profile, device.serial), content_of(device));
}

}  // namespace wrenchd
