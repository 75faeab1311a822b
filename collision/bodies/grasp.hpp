// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>

#include "core/grasp_strength.hpp"
#include "core/pose.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// A body that the tool holds: X_WB = X_WT X_TB until it lets go. core/METHOD.md, section 15.9.
struct Grasp {
  /// Time over which its load is averaged [s]. An impact is larger than the strength for a tick only.
  static constexpr double kLoadTime_s = 0.05;

  std::size_t body = 0;  ///< number of the body in the BodyWorld
  Pose X_TB;
  Wrench load_W;  ///< average load of the body on the tool, about the tool's centre of mass, in axes of W
};

/// After a grasp: the tool goes from where it let go to the pose that the hand commands.
struct ToolReturn {
  static constexpr double kDuration_s = 0.15;

  Pose X_WT;               ///< pose at which it let go
  double elapsed_s = 0.0;  ///< time since it let go
};

}  // namespace wrenchd
