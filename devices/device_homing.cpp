// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/device_homing.hpp"

#include <utility>

namespace wrenchd {

/// A stored offset is never used here, so "once" is asked for like "each_start".
HomingPlan DeviceHoming::with_rest(const DeviceProfile& profile) {
  HomingPlan plan = homing_plan(profile);
  if (plan.reference == ReferenceUse::once) plan.reference = ReferenceUse::each_start;
  return plan;
}

DeviceHoming::DeviceHoming(ProfileDevice& device, DeviceProfile profile, Extent extent)
    : device_(device),
      profile_(std::move(profile)),
      extent_(extent),
      resting_(profile_.homing.reference != ReferenceUse::never),
      homing_(with_rest(profile_)) {
  device_.recalibrate(profile_);
  if (!resting_ && extent_ == Extent::rest) state_.step = HomingStep::done;
}

const HomingState& DeviceHoming::step(TimePoint now) {
  if (state_.step == HomingStep::done || state_.step == HomingStep::failed) return state_;
  const DeviceSample sample = device_.read_newest(now);
  device_.write(now, {}, false);
  lost_ = lost_ || sample.fault == Fault::device_lost;
  state_ = homing_.advance(sample, now);
  if (resting_ && state_.step == HomingStep::settling) take_rest(sample);
  return state_;
}

/// The poses of this sample on are those of the device with its offsets, so the axes begin with a plan that
/// asks for no rest.
void DeviceHoming::take_rest(const DeviceSample& sample) {
  offsets_ = pose_source(profile_) == PoseSource::joints
                 ? offsets_in_rest(profile_, sample.X_BH, device_.joint_angles())
                 : axis_offsets(homing_.offset());
  device_.recalibrate(calibrated(profile_, offsets_));
  resting_ = false;
  if (extent_ == Extent::rest) {
    state_ = {};
    state_.step = HomingStep::done;
    return;
  }
  HomingPlan axes = homing_plan(profile_);
  axes.reference = ReferenceUse::never;
  homing_ = Homing(axes);
  state_ = homing_.state();
}

}  // namespace wrenchd
