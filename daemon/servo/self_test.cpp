// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/self_test.hpp"

#include "core/watch_limits.hpp"

namespace wrenchd {
namespace {

constexpr double kSlowest = 0.9;
constexpr double kFastest = 1.1;
/// For the first command to reach the device, and for its report to come back.
constexpr Duration kThereAndBack = std::chrono::milliseconds(20);
/// All that can be wrong with what the device sends.
constexpr FaultSet kUnclean = bit(Fault::report_malformed) | bit(Fault::report_repeated) |
                              bit(Fault::report_missing) | bit(Fault::sample_late) |
                              bit(Fault::pose_not_a_rotation) | bit(Fault::pose_teleported) |
                              bit(Fault::pose_outside) | bit(Fault::pose_stuck);

}  // namespace

SelfTest::SelfTest(const DeviceProfile& profile, double clean_for_s) noexcept
    : clean_for_(from_seconds(clean_for_s)),
      nominal_Hz_(profile.stream == StreamStyle::free_running && profile.pose_report.sequence.present
                      ? profile.report_rate_Hz
                      : 0.0),
      trips_within_(from_seconds(profile.watchdog_s > 0.0 ? profile.watchdog_s : 0.0) + kThereAndBack),
      can_tell_(profile.has_output && profile.watchdog_s > 0.0 && profile.pose_report.motors_on.present &&
                profile.pose_report.watchdog_tripped.present) {}

void SelfTest::begin(TimePoint now) noexcept {
  phase_ = clean_for_ > Duration{0} ? Phase::clean : Phase::passed;
  begun_ = phase_since_ = now;
  counting_ = false;
  rate_Hz_ = 0.0;
}

void SelfTest::go_on(Phase phase, TimePoint now) noexcept {
  phase_ = phase;
  phase_since_ = now;
}

Fault SelfTest::look(const DeviceSample& sample, FaultSet found, TimePoint now) noexcept {
  const Duration in_phase = now - phase_since_;
  switch (phase_) {
    case Phase::clean:
      return measure(sample, found, now);
    case Phase::waking:
      if (sample.fresh && sample.motors_on)
        go_on(Phase::silent, now);
      else if (in_phase > kThereAndBack)
        return Fault::test_watchdog;
      return Fault::none;
    case Phase::silent:
      if (sample.fresh && sample.watchdog_tripped && !sample.motors_on)
        go_on(Phase::passed, now);
      else if (in_phase > trips_within_)
        return Fault::test_watchdog;
      return Fault::none;
    case Phase::passed:
      break;
  }
  return Fault::none;
}

/// A bad report, and the time of good ones begins anew.
Fault SelfTest::measure(const DeviceSample& sample, FaultSet found, TimePoint now) noexcept {
  if (!sample.homed) begun_ = now;  // somebody has to move it first
  if (now - begun_ > kTestFor) return Fault::test_unclean;
  if (!sample.homed || (found & kUnclean) != 0 || sample.fault != Fault::none) {
    counting_ = false;
    return Fault::none;
  }
  if (!sample.fresh) return Fault::none;
  if (!counting_) {
    counting_ = true;
    clean_since_ = now;
    first_arrived_ = sample.arrived;
    first_sequence_ = sample.sequence;
    return Fault::none;
  }
  if (now - clean_since_ < clean_for_) return Fault::none;
  rate_Hz_ =
      static_cast<double>(sample.sequence - first_sequence_) / seconds(sample.arrived - first_arrived_);
  if (nominal_Hz_ > 0.0 && !(rate_Hz_ >= kSlowest * nominal_Hz_ && rate_Hz_ <= kFastest * nominal_Hz_))
    return Fault::test_rate;
  go_on(can_tell_ ? Phase::waking : Phase::passed, now);
  return Fault::none;
}

}  // namespace wrenchd
