// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/device_profile.hpp"
#include "core/fault.hpp"
#include "daemon/servo/client_watch.hpp"
#include "daemon/servo/link_watch.hpp"
#include "daemon/servo/motor_stall_watch.hpp"
#include "daemon/servo/motor_watch.hpp"
#include "daemon/servo/pose_watch.hpp"
#include "daemon/servo/tick_clock.hpp"
#include "devices/device.hpp"

namespace wrenchd {

/// Fault detectors for the sample, its link, the buttons, the motors and the client. A detector returns the
/// faults it finds; the state machine decides how the loop reacts. daemon/servo/README.md, section "Fault
/// detectors". All members except the constructor are RT-safe.
struct Watches {
  /// max_force_N, max_torque_Nm: limits of the wrench; 0 if the device has no such motors. Not RT-safe: for
  /// set-up.
  Watches(const DeviceProfile& profile, double max_force_N, double max_torque_Nm);

  LinkWatch link;
  PoseWatch pose;
  MotorWatch motors;
  MotorStallWatch motor_stall;
  ClientWatch client;
  std::uint32_t deadman_button;  ///< Bit of the dead man's button; 0 if the profile names none.
  std::uint32_t stop_button;     ///< Bit of the stop button; 0 if the profile names none.
  bool has_motors;               ///< True if the device can output a wrench.

  /// Returns the faults of this sample. driven: true if the last command enabled the motors.
  FaultSet check(const DeviceSample& sample, State state, bool driven, const TickTime& t) noexcept;
  /// Resets the link, pose and motor detectors for a newly opened device.
  void reset() noexcept;

 private:
  FaultSet classify_sample_fault(Fault fault, State state, bool recently_late) const noexcept;
  FaultSet check_buttons(const DeviceSample& sample, State state) const noexcept;

  bool was_homed_ = false;  ///< True if the last report showed that the encoders have their reference.
};

}  // namespace wrenchd
