// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/stability_analysis.hpp"

#include <algorithm>
#include <cmath>

#include "core/finite.hpp"

namespace wrenchd {
namespace {

/// The translational method's torque is the lever of its force, and no spring of its own: the angular gain
/// stands for that too.
Coupling coupling_of(const Settings& settings, const Inertia& M) {
  const WrenchGains& gains = settings.wrench.gains;
  const bool pid = settings.wrench.law == SpringLaw::pid;
  return {pid ? gains.stiffness : energy_stiffness(M, settings.wrench.energy_stiffness_per_s2),
          gains.damping};
}

double share_of(double most, double asked) {
  return is_finite(most) && asked > most ? most / asked : 1.0;
}

/// Nothing is assumed of a device that states nothing.
DeviceDamping stated(const DeviceProfile& profile) {
  return {profile.damping_N_s_per_m, profile.damping_Nm_s_per_rad};
}

EncoderStep step_of(const DeviceProfile& profile) {
  const auto stated_or_none = [](double step) { return is_finite(step) ? step : 0.0; };
  return {stated_or_none(profile.encoder_step_m), stated_or_none(profile.encoder_step_rad)};
}

}  // namespace

StabilityAnalysis::StabilityAnalysis(const Settings& settings, const DeviceProfile& profile, const Inertia& M,
                                     const Pose& X_HT)
    : damping_(stated(profile)),
      encoder_step_(step_of(profile)),
      coupling_(coupling_of(settings, M)),
      X_HT_(X_HT),
      driven_(driven_dofs(profile)),
      period_s_(1.0 / settings.servo.rate_Hz),
      max_linear_N_per_m_(profile.max_stiffness_N_per_m),
      max_angular_Nm_per_rad_(profile.max_stiffness_Nm_per_rad) {
  compute_scale({period_s_, period_s_}, 1.0);  // what cannot be computed is refused here, and not in the loop
}

/// x_W = s x_H makes K at the handle s K s for translations: as if the device had the 1 / s^2 of its damping.
StiffnessScale StabilityAnalysis::compute_scale(const LoopDelay& loop, double workspace_scale) const {
  const double square = workspace_scale * workspace_scale;
  const Matrix6d& K = coupling_.stiffness;
  StiffnessScale share{
      std::min(share_of(max_linear_N_per_m_ / square, K.topLeftCorner<3, 3>().diagonal().maxCoeff()),
               share_of(max_angular_Nm_per_rad_, K.bottomRightCorner<3, 3>().diagonal().maxCoeff())),
      1.0, false};
  const bool linear = (driven_ & kLinearDofs) == 0 || is_finite(damping_.linear_N_s_per_m);
  const bool angular = (driven_ & kAngularDofs) == 0 || is_finite(damping_.angular_Nm_s_per_rad);
  if (!linear || !angular) return share;
  const DeviceDamping damping = {damping_.linear_N_s_per_m / square, damping_.angular_Nm_s_per_rad};
  const EncoderStep step = {workspace_scale * encoder_step_.linear_m, encoder_step_.angular_rad};
  const StabilityBound bound = stability_bound(damping, loop, coupling_, X_HT_, driven_, step);
  share.bound_known = true;
  if (bound.scale >= 1.0) return share;
  const bool without = bound.scale_undamped > bound.scale;
  share.damper = without ? 0.0 : bound.scale;
  share.spring = std::min(share.spring, without ? bound.scale_undamped : bound.scale);
  return share;
}

StiffnessScale StabilityAnalysis::max_stable_scale(const LoopMeasurement& measured,
                                                   double workspace_scale) const noexcept {
  const double period_s = std::max(measured.longest_period_s(), period_s_);
  try {
    return compute_scale({period_s, measured.delay_s()}, workspace_scale);
  } catch (...) {  // the constructor has seen that only the times could do this
    return {0.0, 0.0, true};
  }
}

double StabilityAnalysis::max_stable_scale_at_handle(const LoopMeasurement& measured,
                                                     const LocalModels::TotalGains& load) const noexcept {
  const double late_s = 0.5 * std::max(measured.longest_period_s(), period_s_) + measured.delay_s();
  const auto share_of = [late_s](double b, double k, double d) {
    const double takes = late_s * k + d;
    return is_finite(b) && takes > b ? b / takes : 1.0;
  };
  return std::min(
      share_of(damping_.linear_N_s_per_m, load.stiffness_N_per_m, load.damping_N_s_per_m),
      share_of(damping_.angular_Nm_s_per_rad, load.stiffness_Nm_per_rad, load.damping_Nm_s_per_rad));
}

PassivityGuard StabilityAnalysis::make_passivity_guard(const LoopMeasurement& measured) const noexcept {
  PassivityLimits caps;
  const double ticks = std::round(measured.typical_delay_s() / period_s_);
  const auto most = static_cast<double>(PassivityGuard::kMaxDelay_ticks);
  caps.delay_ticks = is_finite(ticks) ? static_cast<std::size_t>(std::clamp(ticks, 1.0, most))
                                      : PassivityGuard::kMaxDelay_ticks;
  return PassivityGuard(damping_, caps);
}

}  // namespace wrenchd
