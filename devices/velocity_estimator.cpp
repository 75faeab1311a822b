// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/velocity_estimator.hpp"

#include <algorithm>
#include <cmath>

#include "core/finite.hpp"
#include "devices/kinematics.hpp"
#include "devices/profile_reports.hpp"

namespace wrenchd {
namespace {

/// Encoder step of a device whose profile does not state it: fine enough that no real motion counts as noise.
constexpr double kAssumedStep_m = 10e-6;
constexpr double kAssumedStep_rad = 2e-4;
/// Error of an arrival time at the host: reports of full-speed USB wait for a frame of 1 ms, and the time of
/// their arrival varies by a fraction of it.
constexpr double kHostTimeError_s = 1e-4;

/// Largest displacement and rotation of the handle by one count of a joint, at the home position.
VelocityEstimator::Settings joint_steps(const Kinematics& k) {
  VelocityEstimator::Settings steps;
  const std::optional<Pose> X_DE = home_pose(k);
  if (!X_DE) return steps;
  const Matrix3d J = jacobian(k, joint_angles(k, k.home_counts), *X_DE);
  for (std::size_t i = 0; i < k.joints; ++i) {
    const double count_rad = std::abs(k.rad_per_count[i]);
    if (i < kMaxMotors)
      steps.step_m = std::max(steps.step_m, J.col(static_cast<Eigen::Index>(i)).norm() * count_rad);
    steps.step_rad = std::max(steps.step_rad, count_rad);
  }
  return steps;
}

double stated_or(double stated, double otherwise, double assumed) noexcept {
  if (is_finite(stated) && stated > 0.0) return stated;
  return is_finite(otherwise) && otherwise > 0.0 ? otherwise : assumed;
}

}  // namespace

Twist VelocityEstimator::update(double t_s, const Pose& X_BH) noexcept {
  if (previous_R_BH_ && t_s < previous_time_s_) reset();
  if (previous_R_BH_) phi_rad_ += rotation_vector(X_BH.rotation * previous_R_BH_->conjugate());
  previous_R_BH_ = X_BH.rotation;
  previous_time_s_ = t_s;
  return {linear_.update(t_s, X_BH.translation_m), angular_.update(t_s, phi_rad_)};
}

void VelocityEstimator::reset() noexcept {
  linear_.reset();
  angular_.reset();
  previous_R_BH_.reset();
  phi_rad_.setZero();
}

VelocityEstimator::Settings velocity_estimator_settings(const DeviceProfile& profile) {
  VelocityEstimator::Settings settings;
  if (profile.kinematics.kind != Kinematics::Kind::none) settings = joint_steps(profile.kinematics);
  const auto field_step = [&](ReportField PoseReportLayout::*field, double assumed) {
    const ReportField& stated = profile.pose_report.*field;
    return stated.present ? std::max(std::abs(stated.step), assumed) : 0.0;
  };
  const double field_m = field_step(&PoseReportLayout::position, kAssumedStep_m);
  const double field_rad = field_step(&PoseReportLayout::orientation, kAssumedStep_rad);
  settings.step_m = stated_or(profile.encoder_step_m, std::max(settings.step_m, field_m), kAssumedStep_m);
  settings.step_rad =
      stated_or(profile.encoder_step_rad, std::max(settings.step_rad, field_rad), kAssumedStep_rad);
  settings.time_error_s = kHostTimeError_s;
  const auto use_device_clock = [&](const PoseReportLayout& report) {
    if (report.device_time.present) settings.time_error_s = 0.5 * std::abs(report.device_time.step);
  };
  use_device_clock(profile.pose_report);
  for (const PoseReportLayout& report : profile.more_reports) use_device_clock(report);
  return settings;
}

DofMask estimated_velocity_dofs(const DeviceProfile& profile) noexcept {
  if (pose_source(profile) == PoseSource::deflection) return kNoDof;
  DofMask estimated = sensed_dofs(profile);
  if (any_report(profile, &PoseReportLayout::linear_velocity)) estimated &= kAngularDofs;
  if (any_report(profile, &PoseReportLayout::angular_velocity)) estimated &= kLinearDofs;
  return estimated;
}

}  // namespace wrenchd
