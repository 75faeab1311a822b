// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

namespace wrenchd {

/// What an axis of a device reports where it should report zero.
///
///   true = reported - offset
struct AxisOffset {
  std::string axis;     ///< as the device's profile calls it: letters, digits, _ and -
  double offset = 0.0;  ///< [m] or [rad], as the axis is
};

/// What was measured of one device, where the profile speaks of its model.
struct Calibration {
  std::string profile;  ///< name of the profile it was measured with
  std::string serial;   ///< of the device, any bytes; equal devices of a model are told apart by it
  std::vector<AxisOffset> offsets;
};

}  // namespace wrenchd
