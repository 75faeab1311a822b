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

/// Detectors of faults in the sample, its link, the buttons, the motors and the client. They report faults;
/// the state machine decides what follows. All members but the constructor are RT-safe.
struct Watches {
  /// max_force_N, max_torque_Nm: the limits that hold. Not RT-safe: reads the profile.
  Watches(const DeviceProfile& profile, double max_force_N, double max_torque_Nm);

  LinkWatch link;
  PoseWatch pose;
  MotorWatch motors;
  MotorStallWatch motor_stall;
  ClientWatch client;
  std::uint32_t
      deadman_button;         ///< Bit of the button that must be held while force is on; 0 if there is none.
  std::uint32_t stop_button;  ///< Bit of the emergency stop button; 0 if there is none.
  bool has_motors;            ///< The device takes wrenches.

  /// Faults of a sample. driven: the last command switched the motors on.
  FaultSet check(const DeviceSample& sample, State state, bool driven, const TickTime& t) noexcept;
  /// Forgets the device: another one may be opened next.
  void reset() noexcept;

 private:
  FaultSet classify_sample_fault(Fault fault, State state, bool recently_late) const noexcept;
  FaultSet check_buttons(const DeviceSample& sample, State state) const noexcept;

  bool was_homed_ = false;  ///< The previous sample said that the encoders are homed.
};

}  // namespace wrenchd
