// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "devices/kinematics.hpp"
#include "devices/simulation/emulated_device.hpp"

namespace wrenchd {

/// Emulated device that sends encoder counts and accepts motor efforts; the host computes the kinematics. All
/// members except start() are RT-safe.
class EmulatedArm : public EmulatedDevice {
 public:
  /// Sets the encoders to these counts, rounded to the nearest integer, in the order of the report. RT-safe.
  virtual void set_counts(const JointCounts& counts) noexcept = 0;
  /// Returns the motor efforts, in the unit of the efforts of the profile. RT-safe.
  virtual MotorEfforts motor_efforts() const noexcept = 0;

  /// Performs the start-up that a driver performs before the first report. Not RT-safe: allocates.
  virtual void start() {}
  /// Returns true while the host requests that the operator homes the encoders. perform_homing() performs the
  /// homing motion. RT-safe.
  virtual bool homing_requested() const noexcept { return false; }
  virtual void perform_homing() noexcept {}
};

}  // namespace wrenchd
