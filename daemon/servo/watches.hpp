// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "config/settings.hpp"
#include "core/device_profile.hpp"
#include "core/fault.hpp"
#include "core/state.hpp"
#include "daemon/servo/client_watch.hpp"
#include "daemon/servo/link_watch.hpp"
#include "daemon/servo/motor_stall_watch.hpp"
#include "daemon/servo/motor_watch.hpp"
#include "daemon/servo/pace_watch.hpp"
#include "daemon/servo/pose_watch.hpp"
#include "daemon/servo/write_watch.hpp"
#include "devices/device.hpp"

namespace wrenchd {

/// All fault detectors of a tick. A detector returns the faults it finds; the state machine decides how the
/// loop reacts. daemon/servo/README.md, section "Fault detectors".
struct Watches {
  /// max_force_N, max_torque_Nm: limits of the wrench; 0 if the device has no such motors. RT-safe.
  Watches(const Settings& settings, const DeviceProfile& profile, double max_force_N, double max_torque_Nm);

  PaceWatch pace;
  LinkWatch link;
  PoseWatch pose;
  MotorWatch motors;
  WriteWatch writes;
  MotorStallWatch motor_stall;
  ClientWatch client;
  std::uint32_t deadman_button;  ///< Bit of the dead man's button; 0 if the profile names none.
  std::uint32_t stop_button;     ///< Bit of the stop button; 0 if the profile names none.
  bool has_motors;               ///< True if the device can output a wrench.

  /// Returns the faults of the link, pose, motor, button and client detectors for this sample. driven: true
  /// if the last command enabled the motors. RT-safe.
  FaultSet check(const DeviceSample& sample, State state, bool driven, TimePoint now) noexcept;
  /// Resets the link, pose, motor and write detectors for a newly opened device. RT-safe.
  void reset() noexcept;

 private:
  FaultSet classify_sample_fault(Fault fault, State state, TimePoint now) const noexcept;
  FaultSet check_buttons(const DeviceSample& sample, State state) const noexcept;

  bool was_homed_ = false;  ///< True if the last report said that the encoders have their reference.
};

}  // namespace wrenchd
