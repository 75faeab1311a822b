// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/contact_stabilizer.hpp"

namespace wrenchd {
namespace {

/// Assumed round trip of a command in report periods, for a device that acknowledges no commands.
constexpr double kAssumedPeriods = 2.0;
/// Factor on the wrench for each oscillation. The third oscillation after arming is a fault.
constexpr double kOscillationScale = 0.5;
constexpr int kMaxOscillations = 3;

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

void ContactStabilizer::update_measurement(const DeviceSample& sample, std::uint64_t last_command_sent,
                                           TimePoint now) noexcept {
  measurement_.tick({now, sample.arrived, sample.device_time_s, sample.sequence, sample.fresh,
                     device_acknowledges_, sample.acknowledged, last_command_sent});
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

/// The guard depends on device and delay only, so it stays.
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

Wrench ContactStabilizer::stabilize(const Wrench& requested, const DeviceSample& sample,
                                    const ContactInput& input) noexcept {
  faults_ = 0;
  const bool ramp_ended = last_state_ == State::ramping && input.state == State::active;
  last_state_ = input.state;
  if (!is_driving(last_state_) || last_state_ == State::ramping || !wrench_about_handle_) {
    reset_guard(last_state_);
    return requested;
  }
  if (ramp_ended) guard_.credit(input.stored_energy_J);
  double dt_s = 0.0;
  if (input.sample_usable) {
    if (guard_active_) dt_s = sample.device_time_s - guard_sample_time_s_;
    guard_active_ = true;
    guard_sample_time_s_ = sample.device_time_s;
    detect_oscillation(oscillation_gain_ * requested, sample, dt_s, input.in_contact);
  }
  const Wrench limited = guard_.limit(oscillation_gain_ * requested, sample.X_BH, dt_s, input.in_contact);
  if (guard_.energy_runaway()) faults_ |= bit(Fault::energy_generated);
  return limited;
}

/// State::waiting follows arming, and therefore restores the full wrench.
void ContactStabilizer::reset_guard(State state) noexcept {
  guard_.reset();
  guard_active_ = false;
  if (state != State::waiting) return;
  oscillation_.reset();
  oscillation_count_ = 0;
  oscillation_gain_ = 1.0;
}

void ContactStabilizer::detect_oscillation(const Wrench& requested, const DeviceSample& sample, double dt_s,
                                           bool in_contact) noexcept {
  oscillation_.update(requested, sample.V_BH, dt_s, in_contact);
  if (!oscillation_.oscillates()) return;
  oscillation_gain_ *= kOscillationScale;
  oscillation_.reset();
  faults_ |= bit(++oscillation_count_ < kMaxOscillations ? Fault::oscillating : Fault::oscillation_persists);
}

}  // namespace wrenchd
