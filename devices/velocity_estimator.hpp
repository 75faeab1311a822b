// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "core/device_profile.hpp"
#include "core/spatial.hpp"
#include "devices/windowed_slope.hpp"

namespace wrenchd {

/// Bound of the energy gain of an estimated velocity: the integral of its square is at most kEstimateGain^2
/// times that of the true velocity, whatever windows the estimator chooses (core/METHOD.md, section 10.6). A
/// damper that acts on it counts by this factor in the stability bound.
inline constexpr double kEstimateGain = 2.0;

/// Estimates the twist of the handle from its poses and the times at which the device sampled them, for a
/// device that reports no velocity. Translation and rotation have windows of their own (WindowedSlope). The
/// estimate of the rotation is the slope of the sum of the rotation vectors from pose to pose, in B:
///
///   phi_k = phi_(k-1) + log(R_k R_(k-1)^-1)        d phi / dt = w exactly
///
/// The delay is at most half of WindowedSlope::kMaxWindow_s. Lost reports lengthen the intervals, but not the
/// longest window. All members are RT-safe.
class VelocityEstimator {
 public:
  struct Settings {
    double step_m = 0.0;        ///< displacement of the handle by one encoder step
    double step_rad = 0.0;      ///< rotation of the handle by one encoder step
    double time_error_s = 0.0;  ///< largest error of the sample times
  };

  VelocityEstimator() noexcept : VelocityEstimator(Settings{}) {}
  explicit VelocityEstimator(const Settings& settings) noexcept
      : linear_(settings.step_m, settings.time_error_s), angular_(settings.step_rad, settings.time_error_s) {}

  /// Adds the pose that the device sampled at t_s and returns the twist of the handle point, in B. Returns
  /// zero for the first pose, and for the first one after a gap longer than WindowedSlope::kMaxWindow_s. A
  /// time that decreases restarts the estimate.
  Twist update(double t_s, const Pose& X_BH) noexcept;
  /// Discards all poses: after a gap, a fault, a reconnection or a change of the frames.
  void reset() noexcept;

  double linear_window_s() const noexcept { return linear_.window_s(); }
  double angular_window_s() const noexcept { return angular_.window_s(); }

 private:
  WindowedSlope linear_, angular_;
  std::optional<Quaterniond> previous_R_BH_;
  double previous_time_s_ = 0.0;
  Vector3d phi_rad_ = Vector3d::Zero();  ///< sum of the rotation vectors since reset()
};

/// Settings for a profile: the stated encoder step, else the step of its joint encoders at the home position,
/// else the step of the report fields, at least kAssumedStep. Without a device clock the sample times are
/// those of the arrival at the host. Not RT-safe: intended for set-up.
VelocityEstimator::Settings velocity_estimator_settings(const DeviceProfile& profile);

/// Degrees of freedom that the device senses, but whose velocity it does not report: wrenchd estimates it.
/// The velocity of a steered pose is known and counts as reported.
DofMask estimated_velocity_dofs(const DeviceProfile& profile) noexcept;

}  // namespace wrenchd
