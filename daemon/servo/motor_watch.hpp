// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/clock.hpp"
#include "core/fault.hpp"
#include "devices/device.hpp"

namespace wrenchd {

/// Detects motors that are off although the last command enabled them, from the motor and watchdog flags in
/// the device's reports.
class MotorWatch {
 public:
  /// Returns motors_off, watchdog_tripped or no fault. driven: true if the last command enabled the motors. A
  /// flag counts after kMotorsOff at the earliest, unless the motors have been on since. RT-safe.
  FaultSet check(const DeviceSample& sample, bool driven, TimePoint now) noexcept;

 private:
  bool driven_ = false;    ///< Value of `driven` in the previous tick.
  bool seen_on_ = false;   ///< True if a report showed the motors on since they were enabled.
  TimePoint off_since_{};  ///< Time of enabling, or of the last report with the motors on.
};

}  // namespace wrenchd
