// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "core/simulation_settings.hpp"
#include "devices/report_codec.hpp"

namespace wrenchd {

/// What runs inside a device that follows devices/README.md: encoders, velocity estimate, command checks and
/// the watchdog. It is the reference for firmware written elsewhere, so it knows only what a firmware knows.
/// Everything but construction is RT safe.
class SimulatedFirmware {
 public:
  /// No command may be held longer, whatever it asks for [s].
  static constexpr double kMaxHold_s = 0.032;

  /// `sample_period`: between two calls of sample().
  SimulatedFirmware(const DeviceProfile& profile, const SimulationSettings& settings, Duration sample_period);

  /// Reads the encoders with the handle at rest: where the velocity estimate starts.
  void initialize_encoders(const Pose& X_BH) noexcept;
  /// Reads the encoders and updates the velocity estimate. The position is rounded to its quantum in each
  /// coordinate, the rotation in each coordinate of its rotation vector from the base.
  void sample(const Pose& X_BH) noexcept;

  /// The next pose report, from the last sample. Counts the sequence.
  PoseReport make_report(Duration since_power_on) noexcept;
  /// Reports that were due and never made: the sequence goes on as if they had been sent.
  void skip_reports(std::uint32_t count) noexcept { sequence_ += count; }

  /// Takes a command that arrived now. False where it is not one, or is a repetition, or is out of order:
  /// then it has no effect and does not feed the watchdog.
  bool take_command(TimePoint now, std::span<const std::uint8_t> bytes) noexcept;
  /// What the motors are told until the given time. Trips the watchdog if the command may not be held so
  /// long.
  Wrench motor_wrench(TimePoint until) noexcept;
  /// Motors off, and the host is told why.
  void trip_watchdog() noexcept;

  // What may be wrong with a firmware, for tests.
  /// False: the watchdog never trips.
  void set_watchdog_enabled(bool awake) noexcept { watchdog_enabled_ = awake; }
  /// Motors off, and the watchdog has nothing to do with it.
  void switch_motors_off() noexcept {
    motors_on_ = false;
    command_ = {};
  }

  bool motors_on() const noexcept { return motors_on_; }
  bool watchdog_tripped() const noexcept { return watchdog_tripped_; }
  std::uint64_t commands_rejected() const noexcept { return commands_rejected_; }

 private:
  struct Encoder {
    Vector3d position_m;
    Quaterniond rotation;
  };
  Encoder read_encoders(const Pose& X_BH) const noexcept;
  bool in_order(std::uint64_t sequence) const noexcept;

  PoseReportLayout pose_layout_;
  WrenchReportLayout wrench_layout_;
  double position_quantum_m_;
  double rotation_quantum_rad_;
  double default_hold_s_;
  double sample_period_s_;
  double filter_gain_;  ///< share of a new difference in the velocity estimate

  Encoder encoder_{};
  Twist V_BH_;  ///< estimate
  std::uint64_t sequence_ = 0;

  Wrench command_;
  TimePoint hold_until_{};
  std::optional<std::uint64_t> last_command_;  ///< its sequence
  bool motors_on_ = false;
  bool watchdog_tripped_ = false;
  bool watchdog_enabled_ = true;
  std::uint64_t commands_rejected_ = 0;
};

}  // namespace wrenchd
