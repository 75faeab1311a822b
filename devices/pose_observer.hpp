// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/clock.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// Receives the pose of a device with a steered pose, as the user sees it on the screen. The far end of a
/// simulated link implements it, because a simulated hand steers by what it sees. A real hand needs no such
/// interface.
class PoseObserver {
 public:
  /// X_BH: present handle pose in the base. RT-safe.
  virtual void observe_pose(TimePoint now, const Pose& X_BH) noexcept = 0;

 protected:
  ~PoseObserver() = default;
};

}  // namespace wrenchd
