// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

#include "core/grasp_strength.hpp"
#include "core/pose.hpp"

namespace wrenchd {

/// Force and torque about the tool's centre of mass, both in W.
struct ToolLoad {
  Vector3d force_W_N = Vector3d::Zero();
  Vector3d torque_W_Nm = Vector3d::Zero();
};

/// A body that the tool holds: X_WB = X_WT X_TB until it lets go. core/METHOD.md, section 15.9.
struct Grasp {
  /// Time over which its load is averaged [s]. An impact is larger than the strength for a tick only.
  static constexpr double kLoadTime_s = 0.05;

  std::size_t body = 0;  ///< number in the BodyWorld
  Pose X_TB;
  ToolLoad load;  ///< average load that the body puts on the tool
};

/// The way of the tool from where it let go to the pose that the hand commands.
struct ToolReturn {
  static constexpr double kDuration_s = 0.15;

  Pose X_WT;               ///< where it let go
  double elapsed_s = 0.0;  ///< time since then
};

}  // namespace wrenchd
