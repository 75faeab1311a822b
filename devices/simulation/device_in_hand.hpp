// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/spatial.hpp"
#include "devices/simulation/emulated_device.hpp"
#include "devices/simulation/hand_motion.hpp"

namespace wrenchd {

/// Emulated device in a simulated hand. The motion of the hand and the state of the device depend on each
/// other, so the encoders are not set from outside. B = device base, H = handle frame. All members are
/// RT-safe unless stated otherwise.
class DeviceInHand : public EmulatedDevice {
 public:
  /// Notifies the device that a host starts to communicate with it. Not RT-safe: allocates.
  virtual void open(TimePoint /*now*/) {}

  /// Sets the displayed handle pose in B, for a device with a steered pose. The hand observes it. RT-safe.
  virtual void observe_pose(TimePoint /*now*/, const Pose& /*X_BH*/) noexcept {}

  /// Sets a goal of the hand, which leaves its path until the goal expires. Returns false if the handle
  /// follows its path exactly. One thread at a time; any thread. RT-safe.
  virtual bool set_hand_goal(const HandGoal& goal) noexcept = 0;

  /// Displaces the whole path of the hand, in B [m], and the handle with it. Returns false if the device does
  /// not start on its path. Precondition: the device has not been advanced. Not RT-safe.
  virtual bool displace_path(const Vector3d& /*d_B_m*/) { return false; }

  // True state of the handle, for tests; the encoders may report a different one.
  virtual const Pose& X_BH() const noexcept = 0;
  virtual const Wrench& motor_wrench() const noexcept = 0;  ///< wrench on the hand, about H, in B
  virtual const HandTarget& hand_target() const noexcept = 0;
};

}  // namespace wrenchd
