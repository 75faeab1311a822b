// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/self_test.hpp"

#include "core/watch_limits.hpp"

namespace wrenchd {
namespace {

constexpr double kMinRateFactor = 0.9;
constexpr double kMaxRateFactor = 1.1;
/// Longest time from the first command until a report shows its effect.
constexpr Duration kRoundTrip = std::chrono::milliseconds(20);
/// Faults that end a series of faultless reports.
constexpr FaultSet kReportFaults = bit(Fault::report_malformed) | bit(Fault::report_repeated) |
                                   bit(Fault::report_missing) | bit(Fault::sample_late) |
                                   bit(Fault::pose_not_a_rotation) | bit(Fault::pose_jumped) |
                                   bit(Fault::pose_outside_workspace) | bit(Fault::pose_stuck);

}  // namespace

SelfTest::SelfTest(const DeviceProfile& profile, double clean_for_s) noexcept
    : required_clean_(from_seconds(clean_for_s)),
      nominal_rate_Hz_(profile.stream == StreamStyle::free_running && profile.pose_report.sequence.present
                           ? profile.report_rate_Hz
                           : 0.0),
      watchdog_timeout_(from_seconds(profile.watchdog_s > 0.0 ? profile.watchdog_s : 0.0) + kRoundTrip),
      reports_watchdog_(profile.has_output && profile.watchdog_s > 0.0 &&
                        profile.pose_report.motors_on.present &&
                        profile.pose_report.watchdog_tripped.present) {}

void SelfTest::start(TimePoint now) noexcept {
  phase_ = required_clean_ > Duration{0} ? Phase::checking_reports : Phase::passed;
  started_ = phase_since_ = now;
  counting_reports_ = false;
  rate_Hz_ = 0.0;
}

void SelfTest::enter_phase(Phase phase, TimePoint now) noexcept {
  phase_ = phase;
  phase_since_ = now;
}

Fault SelfTest::check(const DeviceSample& sample, FaultSet found, TimePoint now) noexcept {
  const Duration in_phase = now - phase_since_;
  switch (phase_) {
    case Phase::checking_reports:
      return check_reports(sample, found, now);
    case Phase::enabling_motors:
      if (sample.fresh && sample.motors_on)
        enter_phase(Phase::awaiting_watchdog, now);
      else if (in_phase > kRoundTrip)
        return Fault::self_test_watchdog;
      return Fault::none;
    case Phase::awaiting_watchdog:
      if (sample.fresh && sample.watchdog_tripped && !sample.motors_on)
        enter_phase(Phase::passed, now);
      else if (in_phase > watchdog_timeout_)
        return Fault::self_test_watchdog;
      return Fault::none;
    case Phase::passed:
      break;
  }
  return Fault::none;
}

/// A faulty report restarts the series.
Fault SelfTest::check_reports(const DeviceSample& sample, FaultSet found, TimePoint now) noexcept {
  if (!sample.homed) started_ = now;  // the timeout starts when a person has homed the device
  if (now - started_ > kSelfTestTimeout) return Fault::self_test_reports;
  if (!sample.homed || (found & kReportFaults) != 0 || sample.fault != Fault::none) {
    counting_reports_ = false;
    return Fault::none;
  }
  if (!sample.fresh) return Fault::none;
  if (!counting_reports_) {
    counting_reports_ = true;
    clean_since_ = now;
    first_arrived_ = sample.arrived;
    first_sequence_ = sample.sequence;
    return Fault::none;
  }
  if (now - clean_since_ < required_clean_) return Fault::none;
  rate_Hz_ =
      static_cast<double>(sample.sequence - first_sequence_) / seconds(sample.arrived - first_arrived_);
  if (nominal_rate_Hz_ > 0.0 &&
      !(rate_Hz_ >= kMinRateFactor * nominal_rate_Hz_ && rate_Hz_ <= kMaxRateFactor * nominal_rate_Hz_))
    return Fault::self_test_rate;
  enter_phase(reports_watchdog_ ? Phase::enabling_motors : Phase::passed, now);
  return Fault::none;
}

}  // namespace wrenchd
