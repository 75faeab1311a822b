// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "core/fault.hpp"
#include "devices/device.hpp"

namespace wrenchd {

/// Test that a device must pass before it may be armed: faultless reports for a time, the report rate of the
/// profile, and a device watchdog that disables the motors when the host stops sending. For the watchdog test
/// the loop enables the motors with zero wrench and then sends nothing. A device whose reports lack the
/// watchdog and motor flags skips that part.
class SelfTest {
 public:
  /// clean_for_s: time for which the reports must be faultless; 0 skips the whole test. RT-safe.
  SelfTest(const DeviceProfile& profile, double clean_for_s) noexcept;

  /// Starts the test. RT-safe.
  void start(TimePoint now) noexcept;
  /// Advances the test. found: faults that the detectors found in this tick. Returns the fault that failed
  /// the test; Fault::none while it runs and after it passed. Call once per tick after start(). RT-safe.
  Fault check(const DeviceSample& sample, FaultSet found, TimePoint now) noexcept;
  bool passed() const noexcept { return phase_ == Phase::passed; }  ///< RT-safe.

  /// Returns true if the loop must send a command in this tick. RT-safe.
  bool sends_commands() const noexcept { return phase_ != Phase::awaiting_watchdog; }
  /// Returns true if the command of this tick must enable the motors. RT-safe.
  bool motors_on() const noexcept { return phase_ == Phase::enabling_motors; }

  /// Returns the measured report rate; 0 before the measurement is complete. RT-safe.
  double report_rate_Hz() const noexcept { return rate_Hz_; }

 private:
  enum class Phase : std::uint8_t { checking_reports, enabling_motors, awaiting_watchdog, passed };

  Fault check_reports(const DeviceSample& sample, FaultSet found, TimePoint now) noexcept;
  void enter_phase(Phase phase, TimePoint now) noexcept;

  Duration required_clean_;
  double nominal_rate_Hz_;     ///< Report rate that the device must reach; 0 accepts every rate.
  Duration watchdog_timeout_;  ///< Time within which the device watchdog must trip.
  bool reports_watchdog_;      ///< True if the reports contain the motor and watchdog flags.
  Phase phase_ = Phase::checking_reports;
  TimePoint started_{};
  TimePoint phase_since_{};
  bool counting_reports_ = false;     ///< True if clean_since_, first_arrived_ and first_sequence_ are set.
  TimePoint clean_since_{};           ///< Start of the current series of faultless reports.
  TimePoint first_arrived_{};         ///< Arrival time of the first report in the series.
  std::uint64_t first_sequence_ = 0;  ///< Sequence number of the first report in the series.
  double rate_Hz_ = 0.0;
};

}  // namespace wrenchd
