// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/calibration.hpp"
#include "core/device_profile.hpp"
#include "devices/kinematics.hpp"

namespace wrenchd {

// The calibration of one device is applied to its profile, so that all later poses are correct. For a device
// with joints, the calibration has one angle per joint, "joint_1" and so on:
//
//   true angle = reported angle - offset
//
// For every other device it is a PoseOffset (devices/homing.hpp) with the axes x y z rx ry rz.

/// Returns the profile with the calibration applied. Throws std::invalid_argument if the profile does not
/// have one of the axes. Not RT-safe: allocates.
DeviceProfile apply_calibration(DeviceProfile profile, const std::vector<AxisOffset>& offsets);

/// Returns the offsets of a device in its reference pose, from the reported pose X_BH and the reported joint
/// angles (used if the device has joints). Throws std::invalid_argument if no joint angles reach the
/// reference pose of the profile. Not RT-safe: allocates.
std::vector<AxisOffset> offsets_at_reference(const DeviceProfile& profile, const Pose& X_BH,
                                             const JointAngles& angles);

/// Returns the homing plan of a profile: it asks only for the sensed axes. If the profile of a device with
/// joints states no reference pose, the home position is the reference pose. Not RT-safe: allocates.
HomingPlan homing_plan(const DeviceProfile& profile);

}  // namespace wrenchd
