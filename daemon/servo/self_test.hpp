// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "core/fault.hpp"
#include "devices/device.hpp"

namespace wrenchd {

/// What a device has to show before anybody may arm: clean reports for a while, at the rate of its profile,
/// and that its own watchdog frees the hand when the host falls silent. For the last the motors are switched
/// on with zero wrench, then nothing is sent; where a device has no way to tell, it is not asked. RT safe.
class SelfTest {
 public:
  /// clean_for_s: how long the reports have to be good; 0: the whole test is left out.
  SelfTest(const DeviceProfile& profile, double clean_for_s) noexcept;

  void start(TimePoint now) noexcept;
  /// Once a tick, from the first one on. found: what the others found in it. Fault::none while it runs, and
  /// when it has passed.
  Fault check(const DeviceSample& sample, FaultSet found, TimePoint now) noexcept;
  bool passed() const noexcept { return phase_ == Phase::passed; }

  /// What the test wants of the device in this tick.
  bool sends_commands() const noexcept { return phase_ != Phase::awaiting_watchdog; }
  bool motors_on() const noexcept { return phase_ == Phase::enabling_motors; }

  /// Reports a second, as measured; 0 before that.
  double report_rate_Hz() const noexcept { return rate_Hz_; }

 private:
  enum class Phase : std::uint8_t { checking_reports, enabling_motors, awaiting_watchdog, passed };

  Fault check_reports(const DeviceSample& sample, FaultSet found, TimePoint now) noexcept;
  void enter_phase(Phase phase, TimePoint now) noexcept;

  Duration required_clean_;
  double nominal_rate_Hz_;  ///< 0: any will do
  Duration watchdog_timeout_;
  bool reports_watchdog_;  ///< the reports say whether the watchdog tripped
  Phase phase_ = Phase::checking_reports;
  TimePoint started_{};
  TimePoint phase_since_{};
  bool counting_reports_ = false;  ///< clean_since_ and what follows are set
  TimePoint clean_since_{};
  TimePoint first_arrived_{};
  std::uint64_t first_sequence_ = 0;
  double rate_Hz_ = 0.0;
};

}  // namespace wrenchd
