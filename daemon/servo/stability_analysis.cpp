// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/stability_analysis.hpp"

#include <algorithm>
#include <cmath>

#include "core/finite.hpp"
#include "devices/velocity_estimator.hpp"

namespace wrenchd {
namespace {

/// Returns the linearised spring and damper of the configured law. The torque of the translational method is
/// the moment of its force. The angular gain covers that moment too.
Coupling coupling_of(const Settings& settings, const Inertia& M) {
  const WrenchGains& gains = settings.wrench.gains;
  const bool pid = settings.wrench.law == SpringLaw::pid;
  return {pid ? gains.stiffness : energy_stiffness(M, settings.wrench.energy_stiffness_per_s2),
          gains.damping};
}

/// Returns max / value, at most 1; returns 1 if there is no maximum.
double scale_to(double max, double value) {
  return is_finite(max) && value > max ? max / value : 1.0;
}

DeviceDamping stated_damping(const DeviceProfile& profile) {
  return {profile.damping_N_s_per_m, profile.damping_Nm_s_per_rad};
}

/// Factor by which a damper on the velocity along these degrees of freedom counts.
double velocity_gain(const DeviceProfile& profile, DofMask dofs) {
  return (estimated_velocity_dofs(profile) & dofs) != 0 ? kEstimateGain : 1.0;
}

}  // namespace

EncoderStep stated_encoder_step(const DeviceProfile& profile) noexcept {
  const auto stated_or_zero = [](double step) { return is_finite(step) ? step : 0.0; };
  return {stated_or_zero(profile.encoder_step_m), stated_or_zero(profile.encoder_step_rad)};
}

StabilityAnalysis::StabilityAnalysis(const Settings& settings, const DeviceProfile& profile, const Inertia& M,
                                     const Pose& X_HT)
    : damping_(stated_damping(profile)),
      encoder_step_(stated_encoder_step(profile)),
      coupling_(coupling_of(settings, M)),
      X_HT_(X_HT),
      driven_(driven_dofs(profile)),
      period_s_(1.0 / settings.servo.rate_Hz),
      max_linear_N_per_m_(profile.max_stiffness_N_per_m),
      max_angular_Nm_per_rad_(profile.max_stiffness_Nm_per_rad),
      linear_velocity_gain_(velocity_gain(profile, kLinearDofs)),
      angular_velocity_gain_(velocity_gain(profile, kAngularDofs)) {
  compute_scale({period_s_, period_s_}, 1.0);  // throws here, before the loop runs, if the gains are invalid
}

/// With x_W = s x_H the linear stiffness at the handle is s^2 K. That equals a device with 1 / s^2 of its
/// damping, METHOD (82a).
StiffnessScale StabilityAnalysis::compute_scale(const LoopDelay& loop, double workspace_scale) const {
  const double square = workspace_scale * workspace_scale;
  const Matrix6d& K = coupling_.stiffness;
  StiffnessScale scale{
      std::min(scale_to(max_linear_N_per_m_ / square, K.topLeftCorner<3, 3>().diagonal().maxCoeff()),
               scale_to(max_angular_Nm_per_rad_, K.bottomRightCorner<3, 3>().diagonal().maxCoeff())),
      1.0, false};
  const bool linear = (driven_ & kLinearDofs) == 0 || is_finite(damping_.linear_N_s_per_m);
  const bool angular = (driven_ & kAngularDofs) == 0 || is_finite(damping_.angular_Nm_s_per_rad);
  if (!linear || !angular) return scale;
  const DeviceDamping damping = {damping_.linear_N_s_per_m / square, damping_.angular_Nm_s_per_rad};
  const EncoderStep step = {workspace_scale * encoder_step_.linear_m, encoder_step_.angular_rad};
  const StabilityBound bound = stability_bound(damping, loop, coupling_, X_HT_, driven_, step);
  scale.bound_known = true;
  if (bound.scale >= 1.0) return scale;
  const bool omit_damper = bound.scale_undamped > bound.scale;
  scale.damper = omit_damper ? 0.0 : bound.scale;
  scale.spring = std::min(scale.spring, omit_damper ? bound.scale_undamped : bound.scale);
  return scale;
}

StiffnessScale StabilityAnalysis::max_stable_scale(const LoopMeasurement& measured,
                                                   double workspace_scale) const noexcept {
  const double period_s = std::max(measured.longest_period_s(), period_s_);
  try {
    return compute_scale({period_s, measured.delay_s()}, workspace_scale);
  } catch (
      ...) {  // only an invalid period or delay can throw here, because the constructor checked the gains
    return {0.0, 0.0, true};
  }
}

double StabilityAnalysis::max_stable_scale_at_handle(const LoopMeasurement& measured,
                                                     const LocalModels::TotalGains& gains) const noexcept {
  const double lag_s = 0.5 * std::max(measured.longest_period_s(), period_s_) + measured.delay_s();
  const auto passive_scale = [lag_s](double b, double k, double d, double velocity_gain) {
    const double required = lag_s * k + velocity_gain * d;
    return is_finite(b) && required > b ? b / required : 1.0;
  };
  return std::min(passive_scale(damping_.linear_N_s_per_m, gains.stiffness_N_per_m, gains.damping_N_s_per_m,
                                linear_velocity_gain_),
                  passive_scale(damping_.angular_Nm_s_per_rad, gains.stiffness_Nm_per_rad,
                                gains.damping_Nm_s_per_rad, angular_velocity_gain_));
}

Matrix6d StabilityAnalysis::stiffness_at_handle(double spring_scale, double workspace_scale) const noexcept {
  Matrix6d K = spring_scale * transform_to_handle(coupling_.stiffness, X_HT_);
  K.topRows<3>() *= workspace_scale;
  K.leftCols<3>() *= workspace_scale;
  return K;
}

double StabilityAnalysis::longest_lag_s(const LoopMeasurement& measured) const noexcept {
  return std::max(measured.longest_period_s(), period_s_) + measured.delay_s();
}

PassivityGuard StabilityAnalysis::make_passivity_guard(const LoopMeasurement& measured) const noexcept {
  PassivityLimits limits;
  const double ticks = std::round(measured.typical_delay_s() / period_s_);
  const auto max_ticks = static_cast<double>(PassivityGuard::kMaxDelay_ticks);
  limits.delay_ticks = is_finite(ticks) ? static_cast<std::size_t>(std::clamp(ticks, 1.0, max_ticks))
                                        : PassivityGuard::kMaxDelay_ticks;
  return PassivityGuard(damping_, limits);
}

/// The longest lag, and one tick more for what an acknowledgement does not show.
WorkAccount StabilityAnalysis::make_work_account(const LoopMeasurement& measured) const noexcept {
  const double ticks = std::ceil(longest_lag_s(measured) / period_s_) + 1.0;
  const auto max_ticks = static_cast<double>(WorkAccount::kMaxDelay_ticks);
  return WorkAccount({is_finite(ticks) ? static_cast<std::size_t>(std::clamp(ticks, 1.0, max_ticks))
                                       : WorkAccount::kMaxDelay_ticks,
                      encoder_step_});
}

}  // namespace wrenchd
