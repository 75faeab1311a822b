// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/calibrated_profile.hpp"

#include <stdexcept>
#include <string>

#include "devices/homing.hpp"

namespace wrenchd {
namespace {

bool has_joints(const DeviceProfile& profile) {
  return pose_source(profile) == PoseSource::joints;
}

std::string joint_name(std::size_t joint) {
  return "joint_" + std::to_string(joint + 1);
}

[[noreturn]] void reject_axis(const DeviceProfile& profile, const std::string& axis) {
  throw std::invalid_argument("the calibration names the axis " + axis + ", which the profile " +
                              profile.name + " does not have; calibrate again");
}

void shift_joint(DeviceProfile& profile, const AxisOffset& offset) {
  Kinematics& k = profile.kinematics;
  for (std::size_t i = 0; i < k.joints; ++i) {
    if (offset.axis != joint_name(i)) continue;
    k.zero_rad[i] -= offset.offset;
    return;
  }
  reject_axis(profile, offset.axis);
}

JointAngles angles_in_rest(const DeviceProfile& profile) {
  const Kinematics& k = profile.kinematics;
  if (!profile.has_reference_pose) return joint_angles(k, k.home_counts);
  const auto angles = inverse(k, inverse(profile.X_BD) * profile.homing.X_BR * inverse(profile.X_EH));
  if (angles) return *angles;
  throw std::invalid_argument(
      "device profile " + profile.name +
      ": homing: no joint angles reach the stated reference pose; correct it in [homing]");
}

}  // namespace

//   p_BH = p_reported - position,   R_BH = R_reported exp(-rotation),   with X_BH = X_BD X_DE X_EH
DeviceProfile apply_calibration(DeviceProfile profile, const std::vector<AxisOffset>& offsets) {
  if (has_joints(profile)) {
    for (const AxisOffset& offset : offsets) shift_joint(profile, offset);
    return profile;
  }
  const auto offset = pose_offset(offsets);
  if (!offset) {
    for (const AxisOffset& one : offsets)
      if (!pose_offset({one})) reject_axis(profile, one.axis);
  }
  profile.X_BD.translation_m -= offset->position_m;
  profile.X_EH.rotation = (profile.X_EH.rotation * rotation_from(-offset->rotation_rad)).normalized();
  return profile;
}

std::vector<AxisOffset> offsets_at_reference(const DeviceProfile& profile, const Pose& X_BH,
                                             const JointAngles& angles) {
  if (!has_joints(profile)) return axis_offsets(offset_between(X_BH, profile.homing.X_BR));
  const Kinematics& k = profile.kinematics;
  const JointAngles true_angles = angles_in_rest(profile);
  std::vector<AxisOffset> offsets;
  for (std::size_t i = 0; i < k.joints; ++i) offsets.push_back({joint_name(i), angles[i] - true_angles[i]});
  return offsets;
}

HomingPlan homing_plan(const DeviceProfile& profile) {
  HomingPlan plan = profile.homing;
  const DofMask sensed = sensed_dofs(profile);
  for (unsigned i = 0; i < 6; ++i) plan.sensed[i] = (sensed >> i & 1u) != 0;
  if (!has_joints(profile) || profile.has_reference_pose) return plan;
  if (const auto X_DE = home_pose(profile.kinematics)) plan.X_BR = profile.X_BD * *X_DE * profile.X_EH;
  return plan;
}

}  // namespace wrenchd
