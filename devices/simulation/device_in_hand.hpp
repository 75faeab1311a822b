// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/spatial.hpp"
#include "devices/simulation/emulated_device.hpp"
#include "devices/simulation/hand_path.hpp"

namespace wrenchd {

/// An emulated device in a simulated hand. What the hand feels and where the device then is decide each
/// other, so nobody has to turn its encoders. B = device base, H = handle point.
class DeviceInHand : public EmulatedDevice {
 public:
  /// A host begins to speak with it. Not RT safe.
  virtual void open(TimePoint /*now*/) {}

  /// Where a pose that is steered has come to, in B: the hand looks at it. RT safe.
  virtual void observe_pose(TimePoint /*now*/, const Pose& /*X_BH*/) noexcept {}

  // The truth, for tests: not what the encoders see.
  virtual const Pose& X_BH() const noexcept = 0;
  virtual const Wrench& motor_wrench() const noexcept = 0;  ///< on the hand, about H, in B
  virtual HandTarget hand_target() const noexcept = 0;
};

}  // namespace wrenchd
