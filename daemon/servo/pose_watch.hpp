// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "core/fault.hpp"
#include "devices/device.hpp"

namespace wrenchd {

/// Detects implausible poses: no valid rotation, far outside the workspace, or constant while the reported
/// twist is not. An estimated twist is no evidence, because it follows from the poses.
class PoseWatch {
 public:
  /// RT-safe.
  explicit PoseWatch(const DeviceProfile& profile) noexcept;

  /// Returns the faults of this sample; samples that are not fresh give none. RT-safe.
  FaultSet check(const DeviceSample& sample) noexcept;
  /// Resets the detector; the next pose counts as the first one. RT-safe.
  void reset() noexcept;

 private:
  bool pose_stuck(const DeviceSample& sample) noexcept;

  Vector3d centre_m_;                ///< Centre of the workspace in B.
  double max_distance_m_;            ///< Largest plausible distance from centre_m_; infinite if not stated.
  int invalid_rotations_ = 0;        ///< Poses without a valid rotation in a row.
  Pose X_BH_reference_;              ///< Last pose that differed from its predecessor.
  bool has_reference_ = false;       ///< True if X_BH_reference_ is set.
  double reference_time_s_ = 0.0;    ///< Device time of X_BH_reference_.
  double last_sample_time_s_ = 0.0;  ///< Device time of the previous sample.
  double expected_path_m_ = 0.0;     ///< Integral of the speed since reference_time_s_.
  double expected_rotation_rad_ = 0.0;  ///< Integral of the angular speed since reference_time_s_.
};

}  // namespace wrenchd
