// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

namespace wrenchd {

/// Zero offset of one axis of a device. The device reports `offset` where the true value is 0.
///
///   true = reported - offset
struct AxisOffset {
  std::string axis;     ///< name of the axis in the device profile: letters, digits, _ and -
  double offset = 0.0;  ///< zero offset, [m] for a linear axis, [rad] for an angular axis
};

/// Values measured on one individual device. They refine the device profile, which describes the model.
struct Calibration {
  std::string profile;  ///< name of the profile that was active during the calibration
  std::string serial;  ///< serial number of the device, any bytes; it distinguishes devices of the same model
  std::vector<AxisOffset> offsets;
};

}  // namespace wrenchd
