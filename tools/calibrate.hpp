// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <string>

#include "core/calibration.hpp"
#include "core/clock.hpp"
#include "devices/profile_device.hpp"

namespace wrenchd {

/// Callbacks to the operator who moves the device during the calibration.
struct OperatorInterface {
  std::function<void(const std::string&)> instruct;  ///< shows the operator the next instruction
  /// Returns true once the operator has confirmed that the handle is at its reference pose.
  std::function<bool()> confirmed;
  std::function<bool()> cancelled;  ///< returns true if the operator has cancelled the calibration
};

/// Calibrates an opened device: first its reference pose, if the profile requires one, then its axes. The
/// motors stay off. Returns the calibration without storing it. Throws std::runtime_error if the calibration
/// fails or is cancelled, or if the device is disconnected. Not RT-safe: waits for the operator.
Calibration calibrate(ProfileDevice& device, const DeviceProfile& profile, const std::string& serial,
                      Clock& clock, const OperatorInterface& person);

struct CalibrateOptions {
  std::string profile = "auto";
  std::string serial;
};

/// `wrenchctl calibrate`: finds the device, calibrates it with the operator at the terminal, and stores the
/// calibration. Returns the exit code. Throws std::runtime_error if no such device is connected or if
/// calibrate() throws. Not RT-safe: waits for the operator.
int run_calibrate(const CalibrateOptions& options);

}  // namespace wrenchd
