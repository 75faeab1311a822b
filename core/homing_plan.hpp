// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>

#include "core/pose.hpp"

namespace wrenchd {

/// When a device has to be shown where it is.
enum class ReferenceSchedule : std::uint8_t {
  never,       ///< it knows: absolute encoders, calibrated by its maker
  once,        ///< absolute encoders, which nobody has aligned: the offset is stored
  each_start,  ///< incremental encoders, which count from wherever they were switched on
};

/// What has to be seen of a device before it may be armed. Axes: x y z of the handle point, then turns about
/// x y z, all in the base, x forward, y left, z up.
struct HomingPlan {
  std::array<bool, 6> sensed = {true, true, true, true, true, true};  ///< only these are asked for
  double travel_m = 0.02;    ///< how far a person moves the handle along an axis; plain to see, soon done
  double travel_rad = 0.25;  ///< likewise about one
  Vector3d workspace_min_m = Vector3d::Constant(-1.0);  ///< p_BH is never outside of this box
  Vector3d workspace_max_m = Vector3d::Constant(1.0);
  double max_rotation_rad = 3.2;  ///< nor is R_BH turned farther than this; above pi: any turn is good

  ReferenceSchedule reference = ReferenceSchedule::never;
  Pose X_BR;                          ///< the handle in its rest, the pose that is known
  double max_offset_m = 0.1;          ///< farther off, the handle is not in its rest
  double max_offset_rad = 0.5;        ///< likewise; encoders that start anywhere need more
  std::uint32_t confirm_buttons = 0;  ///< any of these says "it is in its rest"; 0: only confirm() does
};

}  // namespace wrenchd
