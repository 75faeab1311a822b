// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/pose_watch.hpp"

#include <limits>

#include "core/finite.hpp"
#include "core/watch_limits.hpp"

namespace wrenchd {
namespace {

constexpr int kMaxInvalidRotations = 3;
constexpr double kOutsideFactor = 1.5;  ///< in workspace radii
/// Motion that the twist may predict while the pose is constant: ten steps of the coarsest usable encoder.
constexpr double kUndetected_m = 1e-3;
constexpr double kUndetected_rad = 2e-2;
/// A twist below these values is noise or rest.
constexpr double kRest_m_per_s = 0.02;
constexpr double kRest_rad_per_s = 0.2;

}  // namespace

PoseWatch::PoseWatch(const DeviceProfile& profile) noexcept
    : centre_m_(profile.workspace_centre_m),
      max_distance_m_(is_finite(profile.workspace_radius_m) ? kOutsideFactor * profile.workspace_radius_m
                                                            : std::numeric_limits<double>::infinity()) {}

FaultSet PoseWatch::check(const DeviceSample& sample) noexcept {
  if (!sample.fresh) return 0;
  FaultSet faults = 0;
  invalid_rotations_ = sample.fault == Fault::pose_not_a_rotation ? invalid_rotations_ + 1 : 0;
  if (invalid_rotations_ >= kMaxInvalidRotations) faults |= bit(Fault::pose_not_a_rotation);
  if (sample.fault != Fault::none) return faults;
  if ((sample.X_BH.translation_m - centre_m_).norm() > max_distance_m_)
    faults |= bit(Fault::pose_outside_workspace);
  if (pose_stuck(sample)) faults |= bit(Fault::pose_stuck);
  return faults;
}

bool PoseWatch::pose_stuck(const DeviceSample& sample) noexcept {
  const double now_s = sample.device_time_s;
  const auto reported = [&](DofMask dofs) {
    return (sample.estimated_velocity_dofs & dofs) == 0 ? 1.0 : 0.0;
  };
  const double v_m_per_s = reported(kLinearDofs) * sample.V_BH.linear_m_per_s.norm(),
               w_rad_per_s = reported(kAngularDofs) * sample.V_BH.angular_rad_per_s.norm();
  const bool at_rest = v_m_per_s < kRest_m_per_s && w_rad_per_s < kRest_rad_per_s;
  if (!has_reference_ || at_rest || !same_bits(sample.X_BH, X_BH_reference_) || now_s < last_sample_time_s_) {
    X_BH_reference_ = sample.X_BH;
    has_reference_ = true;
    reference_time_s_ = now_s;
    expected_path_m_ = expected_rotation_rad_ = 0.0;
  } else {
    expected_path_m_ += v_m_per_s * (now_s - last_sample_time_s_);
    expected_rotation_rad_ += w_rad_per_s * (now_s - last_sample_time_s_);
  }
  last_sample_time_s_ = now_s;
  return now_s - reference_time_s_ >= seconds(kStuckPose) &&
         (expected_path_m_ > kUndetected_m || expected_rotation_rad_ > kUndetected_rad);
}

void PoseWatch::reset() noexcept {
  invalid_rotations_ = 0;
  has_reference_ = false;
}

}  // namespace wrenchd
