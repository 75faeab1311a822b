// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/calibration.hpp"
#include "core/device_profile.hpp"
#include "devices/kinematics.hpp"

namespace wrenchd {

// What was measured of one device goes into its profile, so that the poses come out true and nothing else has
// to know of it. Of a device with joints that is an angle a joint, "joint_1" and so on:
//
//   true angle = reported angle - offset
//
// Of any other it is a PoseOffset (devices/homing.hpp), x y z rx ry rz.

/// The profile of the device that this was measured of. Throws std::invalid_argument for an axis that the
/// profile does not have.
DeviceProfile apply_calibration(DeviceProfile profile, const std::vector<AxisOffset>& offsets);

/// The offsets of a device that reports this in its rest: the pose X_BH, and the joint angles where it has
/// joints. Throws std::invalid_argument where the joints cannot hold the rest that the profile states. Not RT
/// safe.
std::vector<AxisOffset> offsets_at_reference(const DeviceProfile& profile, const Pose& X_BH,
                                             const JointAngles& angles);

/// What homing asks of a device of this profile: of the axes it senses, and with the home position of its
/// joints as the rest where no other is stated.
HomingPlan homing_plan(const DeviceProfile& profile);

}  // namespace wrenchd
