// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/stability_monitor.hpp"

namespace wrenchd {
namespace {

/// Time that a command takes to the motors, in periods of the device's reports, if no acknowledgement shows
/// it.
constexpr double kAssumedPeriods = 2.0;

double report_rate_Hz(const Settings& settings, const DeviceProfile& profile) {
  return profile.report_rate_Hz > 0.0 ? profile.report_rate_Hz : settings.servo.rate_Hz;
}

}  // namespace

StabilityMonitor::StabilityMonitor(const Settings& settings, const DeviceProfile& profile,
                                   const StabilityAnalysis& analysis)
    : analysis_(analysis),
      measurement_(kAssumedPeriods / report_rate_Hz(settings, profile)),
      derivation_(measurement_),
      acknowledges_(profile.pose_report.acknowledged.present) {}

void StabilityMonitor::update_measurement(const DeviceSample& sample, std::uint64_t last_command_sent,
                                          TimePoint now) noexcept {
  measurement_.tick({now, sample.arrived, sample.device_time_s, sample.sequence, sample.fresh, acknowledges_,
                     sample.acknowledged, last_command_sent});
}

const StiffnessScale& StabilityMonitor::derive() noexcept {
  derivation_ = measurement_;
  derived_ = true;
  scale_ = max_stable_scale(analysis_);
  return scale_;
}

StiffnessScale StabilityMonitor::max_stable_scale(const StabilityAnalysis& analysis) const noexcept {
  return derived_ ? analysis.max_stable_scale(derivation_, workspace_scale_) : StiffnessScale{};
}

void StabilityMonitor::set_analysis(const StabilityAnalysis& analysis) noexcept {
  analysis_ = analysis;
  scale_ = max_stable_scale(analysis_);
}

bool StabilityMonitor::set_workspace_scale(double workspace_scale) noexcept {
  if (workspace_scale == workspace_scale_) return false;
  workspace_scale_ = workspace_scale;
  scale_ = max_stable_scale(analysis_);
  return true;
}

}  // namespace wrenchd
