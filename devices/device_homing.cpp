// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/device_homing.hpp"

#include <utility>

namespace wrenchd {

/// A stored offset is not used here, so "once" also requests the reference pose.
HomingPlan DeviceHoming::plan_with_reference(const DeviceProfile& profile) {
  HomingPlan plan = homing_plan(profile);
  if (plan.reference == ReferenceSchedule::once) plan.reference = ReferenceSchedule::each_start;
  return plan;
}

DeviceHoming::DeviceHoming(ProfileDevice& device, DeviceProfile profile, Extent extent)
    : device_(device),
      profile_(std::move(profile)),
      extent_(extent),
      reference_pending_(profile_.homing.reference != ReferenceSchedule::never),
      homing_(plan_with_reference(profile_)) {
  device_.recalibrate(profile_);
  if (!reference_pending_ && extent_ == Extent::reference_only) state_.step = HomingStep::done;
}

const HomingState& DeviceHoming::step(TimePoint now) {
  if (state_.step == HomingStep::done || state_.step == HomingStep::failed) return state_;
  const DeviceSample sample = device_.read_newest(now);
  device_.write(now, {}, false);
  device_lost_ = device_lost_ || sample.fault == Fault::device_lost;
  state_ = homing_.advance(sample, now);
  if (reference_pending_ && state_.step == HomingStep::holding_still) apply_reference_offsets(sample);
  return state_;
}

/// From this sample on the device applies the offsets, so the axes are checked with a plan without a
/// reference pose.
void DeviceHoming::apply_reference_offsets(const DeviceSample& sample) {
  offsets_ = pose_source(profile_) == PoseSource::joints
                 ? offsets_at_reference(profile_, sample.X_BH, device_.joint_angles())
                 : axis_offsets(homing_.offset());
  device_.recalibrate(apply_calibration(profile_, offsets_));
  reference_pending_ = false;
  if (extent_ == Extent::reference_only) {
    state_ = {};
    state_.step = HomingStep::done;
    return;
  }
  HomingPlan axes = homing_plan(profile_);
  axes.reference = ReferenceSchedule::never;
  homing_ = Homing(axes);
  state_ = homing_.state();
}

}  // namespace wrenchd
