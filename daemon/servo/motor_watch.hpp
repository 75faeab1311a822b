// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/clock.hpp"
#include "core/fault.hpp"
#include "devices/device.hpp"

namespace wrenchd {

/// Looks whether the motors do as they are told: the device's own word of its watchdog and its motors, while
/// it is driven. RT safe.
class MotorWatch {
 public:
  /// driven: the last command said "motors on".
  FaultSet check(const DeviceSample& sample, bool driven, TimePoint now) noexcept;

 private:
  bool driven_ = false;
  bool seen_on_ = false;   ///< they have been on since they were driven
  TimePoint off_since_{};  ///< driven, and not seen on
};

}  // namespace wrenchd
