// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "config/settings.hpp"
#include "core/device_profile.hpp"
#include "core/fault.hpp"
#include "daemon/servo/client_watch.hpp"
#include "daemon/servo/link_watch.hpp"
#include "daemon/servo/motor_stall_watch.hpp"
#include "daemon/servo/motor_watch.hpp"
#include "daemon/servo/pace_watch.hpp"
#include "daemon/servo/pose_watch.hpp"
#include "daemon/servo/write_watch.hpp"
#include "devices/device.hpp"

namespace wrenchd {

/// Everything that looks for faults in a tick, each by its own rule. They find; what follows is the state
/// machine's. RT safe.
struct Watches {
  Watches(const Settings& settings, const DeviceProfile& profile, double max_force_N, double max_torque_Nm);

  PaceWatch pace;
  LinkWatch link;
  PoseWatch pose;
  MotorWatch motors;
  WriteWatch writes;
  MotorStallWatch motor_stall;
  ClientWatch client;
  std::uint32_t deadman_button;  ///< bit; 0: there is none
  std::uint32_t stop_button;
  bool has_motors;

  /// What the sample says, as of now. driven: the last command switched the motors on.
  FaultSet check(const DeviceSample& sample, State state, bool driven, TimePoint now) noexcept;
  /// Another device may come.
  void reset() noexcept;

 private:
  FaultSet classify_sample_fault(Fault fault, State state, TimePoint now) const noexcept;
  FaultSet check_buttons(const DeviceSample& sample, State state) const noexcept;

  bool was_homed_ = false;  ///< it has been
};

}  // namespace wrenchd
