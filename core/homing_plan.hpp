// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>

#include "core/pose.hpp"

namespace wrenchd {

/// When a device needs a reference pose (homing).
enum class ReferenceSchedule : std::uint8_t {
  never,       ///< absolute encoders, calibrated by the manufacturer
  once,        ///< absolute encoders with unknown offset: homed once, wrenchd stores the offset
  each_start,  ///< incremental encoders, which start from an arbitrary pose
};

/// Homing requirements that a device must meet before it may be armed. Axes: x, y, z of the handle point,
/// then rotation about x, y, z; in the base, x forward, y left, z up.
struct HomingPlan {
  /// axes that the device senses; homing asks for motion along these only
  std::array<bool, 6> sensed = {true, true, true, true, true, true};
  double travel_m = 0.02;    ///< distance by which a person moves the handle along a linear axis
  double travel_rad = 0.25;  ///< angle by which a person rotates the handle about an axis
  /// lower corner of the box that contains every valid p_BH
  Vector3d workspace_min_m = Vector3d::Constant(-1.0);
  Vector3d workspace_max_m = Vector3d::Constant(1.0);
  double max_rotation_rad = 3.2;  ///< largest valid rotation angle of R_BH; above pi: any rotation is valid

  ReferenceSchedule reference = ReferenceSchedule::never;
  Pose X_BR;  ///< known reference pose of the handle
  /// largest valid distance between reference pose and reported pose; beyond it homing rejects the reference
  double max_offset_m = 0.1;
  /// largest valid angle between reference pose and reported pose; incremental encoders need a larger value
  double max_offset_rad = 0.5;
  std::uint32_t confirm_buttons =
      0;  ///< any of these buttons confirms the reference pose; 0: only confirm() does
};

}  // namespace wrenchd
