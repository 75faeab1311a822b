// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "devices/calibrated_profile.hpp"
#include "devices/homing.hpp"
#include "devices/profile_device.hpp"

namespace wrenchd {

/// Homes one opened device, motors off: first its rest, where the profile asks for one, which gives the
/// offsets; then, with these taken over by the device, its axes. Homing (devices/homing.hpp) judges; here it
/// is given what the device reports.
class DeviceHoming {
 public:
  enum class Extent : std::uint8_t {
    reference_only,  ///< what a device needs at each start
    full,            ///< a calibration: the rest and the axes
  };

  /// The device has to be open; offsets that it took over before are forgotten. Throws std::invalid_argument
  /// where the profile's plan cannot work.
  DeviceHoming(ProfileDevice& device, DeviceProfile profile, Extent extent);

  /// Reads the device once, and sends it zeros. About once a millisecond; not RT safe.
  const HomingState& step(TimePoint now);
  /// A person says that the handle is in its rest.
  void confirm() noexcept { homing_.confirm(); }

  const HomingState& state() const noexcept { return state_; }
  /// What the rest has shown; empty before that, and where the profile asks for no rest.
  const std::vector<AxisOffset>& offsets() const noexcept { return offsets_; }
  bool device_lost() const noexcept { return device_lost_; }  ///< the device was unplugged on the way

 private:
  static HomingPlan plan_with_reference(const DeviceProfile& profile);
  void apply_reference_offsets(const DeviceSample& sample);

  ProfileDevice& device_;
  DeviceProfile profile_;
  Extent extent_;
  bool reference_pending_;  ///< the rest has not been shown yet
  Homing homing_;
  HomingState state_;
  std::vector<AxisOffset> offsets_;
  bool device_lost_ = false;
};

}  // namespace wrenchd
