// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <string>

#include "core/calibration.hpp"
#include "core/clock.hpp"
#include "devices/profile_device.hpp"

namespace wrenchd {

/// The person beside the device.
struct OperatorInterface {
  std::function<void(const std::string&)> instruct;  ///< a sentence on what to do
  std::function<bool()> confirmed;                   ///< whether the handle is in its rest, by now
  std::function<bool()> cancelled;                   ///< whether they have had enough
};

/// Calibrates an opened device: its rest, where the profile asks for one, and its axes, motors off all the
/// while. Throws std::runtime_error where it failed, was lost or was stopped; nothing is stored here.
Calibration calibrate(ProfileDevice& device, const DeviceProfile& profile, const std::string& serial,
                      Clock& clock, const OperatorInterface& person);

struct CalibrateOptions {
  std::string profile = "auto";
  std::string serial;
};

/// `wrenchctl calibrate`: finds the device, calibrates it with whoever sits at the terminal, and stores what
/// it found. Returns the exit code. Throws as calibrate() does, and where there is no such device.
int run_calibrate(const CalibrateOptions& options);

}  // namespace wrenchd
