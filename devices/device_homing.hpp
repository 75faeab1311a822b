// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "devices/calibrated_profile.hpp"
#include "devices/homing.hpp"
#include "devices/profile_device.hpp"

namespace wrenchd {

/// Homes one opened device with its motors off. If the profile requires a reference, the first step measures
/// the offsets in the reference pose and applies them to the device. Then it checks the axes. Homing
/// (devices/homing.hpp) evaluates the samples; DeviceHoming reads them from the device. Not RT-safe:
/// allocates.
class DeviceHoming {
 public:
  enum class Extent : std::uint8_t {
    reference_only,  ///< only the reference pose, at each start
    full,            ///< a full calibration: the reference pose and the axes
  };

  /// The device must be open. Removes offsets that were applied before. Throws std::invalid_argument if the
  /// homing plan of the profile is invalid.
  DeviceHoming(ProfileDevice& device, DeviceProfile profile, Extent extent);

  /// Reads the device once and sends a zero wrench. Call it about once per millisecond. Not RT-safe:
  /// allocates.
  const HomingState& step(TimePoint now);
  /// The operator confirms that the handle is in the reference pose.
  void confirm() noexcept { homing_.confirm(); }

  const HomingState& state() const noexcept { return state_; }
  /// Returns the measured offsets. Empty before the measurement, or if the profile requires no reference.
  const std::vector<AxisOffset>& offsets() const noexcept { return offsets_; }
  /// True if the device was unplugged during homing.
  bool device_lost() const noexcept { return device_lost_; }

 private:
  static HomingPlan plan_with_reference(const DeviceProfile& profile);
  void apply_reference_offsets(const DeviceSample& sample);

  ProfileDevice& device_;
  DeviceProfile profile_;
  Extent extent_;
  bool reference_pending_;  ///< true until the reference pose has been measured
  Homing homing_;
  HomingState state_;
  std::vector<AxisOffset> offsets_;
  bool device_lost_ = false;
};

}  // namespace wrenchd
