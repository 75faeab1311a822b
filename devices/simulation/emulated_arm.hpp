// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "devices/kinematics.hpp"
#include "devices/simulation/emulated_device.hpp"

namespace wrenchd {

/// A device that sends what its encoders count and takes what its motors shall do, and leaves all else to the
/// host. RT safe but for start().
class EmulatedArm : public EmulatedDevice {
 public:
  /// The handle is moved: where the encoders stand, to the nearest count, in the order of the report.
  virtual void set_counts(const JointCounts& counts) noexcept = 0;
  /// What the motors do, in the unit that a profile's efforts have.
  virtual MotorEfforts motor_efforts() const noexcept = 0;

  /// What a driver does with it before the first report. Not RT safe.
  virtual void start() {}
  /// Whether the person shall do now what tells the encoders where they are; home() is that.
  virtual bool homing_requested() const noexcept { return false; }
  virtual void perform_homing() noexcept {}
};

}  // namespace wrenchd
