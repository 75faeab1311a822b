// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "core/fault.hpp"
#include "devices/device.hpp"

namespace wrenchd {

/// Looks at what the reports say of the pose: no rotation, outside of the workspace, stuck. RT safe.
class PoseWatch {
 public:
  explicit PoseWatch(const DeviceProfile& profile) noexcept;

  FaultSet check(const DeviceSample& sample) noexcept;
  /// The next pose is the first one.
  void reset() noexcept;

 private:
  bool pose_stuck(const DeviceSample& sample) noexcept;

  Vector3d centre_m_;
  double max_distance_m_;  ///< infinite where the profile has no workspace
  int invalid_rotations_ = 0;
  Pose X_BH_reference_;            ///< the last one that moved
  bool has_reference_ = false;     ///< there is one
  double reference_time_s_ = 0.0;  ///< device time at which it did
  double last_sample_time_s_ = 0.0;
  double expected_path_m_ = 0.0;  ///< that the twist would have gone since
  double expected_rotation_rad_ = 0.0;
};

}  // namespace wrenchd
