// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/contact_stabilizer.hpp"

namespace wrenchd {
namespace {

/// Of the device's reports: how long a command may take where nothing says when it arrived.
constexpr double kAssumedPeriods = 2.0;
/// An oscillation costs half of the stiffness; the third is none of the stiffness's.
constexpr double kCalmer = 0.5;
constexpr int kOscillations = 3;

double report_rate_Hz(const Settings& settings, const DeviceProfile& profile) {
  return profile.report_rate_Hz > 0.0 ? profile.report_rate_Hz : settings.servo.rate_Hz;
}

}  // namespace

ContactStabilizer::ContactStabilizer(const Settings& settings, const DeviceProfile& profile,
                                     const StabilityAnalysis& stability)
    : stability_(stability),
      measurement_(kAssumedPeriods / report_rate_Hz(settings, profile)),
      derivation_measurement_(measurement_),
      guard_(stability_.make_passivity_guard(measurement_)),
      wrench_about_handle_(profile.wrench_point == WrenchPoint::handle),
      device_acknowledges_(profile.pose_report.acknowledged.present) {}

void ContactStabilizer::update_measurement(const DeviceSample& sample, std::uint64_t commanded,
                                           TimePoint now) noexcept {
  measurement_.tick({now, sample.arrived, sample.device_time_s, sample.sequence, sample.fresh,
                     device_acknowledges_, sample.acknowledged, commanded});
}

const StiffnessScale& ContactStabilizer::derive_stiffness() noexcept {
  derivation_measurement_ = measurement_;
  stiffness_derived_ = true;
  stiffness_scale_ = max_stable_scale(stability_);
  guard_ = stability_.make_passivity_guard(measurement_);
  return stiffness_scale_;
}

StiffnessScale ContactStabilizer::max_stable_scale(const StabilityAnalysis& stability) const noexcept {
  return stiffness_derived_ ? stability.max_stable_scale(derivation_measurement_, workspace_scale_)
                            : StiffnessScale{};
}

/// The guard knows the device and the delay, and no walls: it stays.
void ContactStabilizer::set_stability(const StabilityAnalysis& stability) noexcept {
  stability_ = stability;
  stiffness_scale_ = max_stable_scale(stability_);
}

bool ContactStabilizer::set_workspace_scale(double scale) noexcept {
  if (scale == workspace_scale_) return false;
  workspace_scale_ = scale;
  stiffness_scale_ = max_stable_scale(stability_);
  return true;
}

Wrench ContactStabilizer::stabilize(const Wrench& asked, const DeviceSample& sample,
                                    const ContactInput& moment) noexcept {
  faults_ = 0;
  const bool risen = last_state_ == State::ramping && moment.state == State::active;
  last_state_ = moment.state;
  if (!is_driving(last_state_) || last_state_ == State::ramping || !wrench_about_handle_) {
    reset_guard(last_state_);
    return asked;
  }
  if (risen) guard_.credit(moment.stored_energy_J);
  double dt_s = 0.0;
  if (moment.sample_usable) {
    if (guard_active_) dt_s = sample.device_time_s - guard_sample_time_s_;
    guard_active_ = true;
    guard_sample_time_s_ = sample.device_time_s;
    detect_oscillation(oscillation_gain_ * asked, sample, dt_s, moment.in_contact);
  }
  const Wrench left = guard_.limit(oscillation_gain_ * asked, sample.X_BH, dt_s, moment.in_contact);
  if (guard_.energy_runaway()) faults_ |= bit(Fault::energy_generated);
  return left;
}

/// No force, or one that rises: nothing to guard. Whoever arms anew starts with all of the stiffness.
void ContactStabilizer::reset_guard(State state) noexcept {
  guard_.reset();
  guard_active_ = false;
  if (state != State::waiting) return;
  oscillation_.reset();
  oscillation_count_ = 0;
  oscillation_gain_ = 1.0;
}

void ContactStabilizer::detect_oscillation(const Wrench& asked, const DeviceSample& sample, double dt_s,
                                           bool in_contact) noexcept {
  oscillation_.update(asked, sample.V_BH, dt_s, in_contact);
  if (!oscillation_.oscillates()) return;
  oscillation_gain_ *= kCalmer;
  oscillation_.reset();
  faults_ |= bit(++oscillation_count_ < kOscillations ? Fault::oscillating : Fault::oscillation_persists);
}

}  // namespace wrenchd
