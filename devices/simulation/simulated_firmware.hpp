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

/// Firmware of a device that follows devices/README.md: encoders, velocity estimate, command checks and
/// watchdog. It is the reference for other firmware, so it uses only information that a firmware has. All
/// members except the constructor are RT-safe.
class SimulatedFirmware {
 public:
  /// Maximum time for which the firmware applies a command, whatever hold time it requests [s].
  static constexpr double kMaxHold_s = 0.032;

  /// `sample_period`: time between two calls of sample().
  SimulatedFirmware(const DeviceProfile& profile, const SimulationSettings& settings, Duration sample_period);

  /// Reads the encoders with the handle at rest, and resets the velocity estimate to zero. RT-safe.
  void initialize_encoders(const Pose& X_BH) noexcept;
  /// Reads the encoders and updates the velocity estimate. Rounds each coordinate of the position, and each
  /// coordinate of the rotation vector from the base, to its quantum. RT-safe.
  void sample(const Pose& X_BH) noexcept;

  /// Makes the next pose report from the last sample and increments the sequence. RT-safe.
  PoseReport make_report(Duration since_power_on) noexcept;
  /// Skips reports that were due and not made. The sequence continues as if they had been sent. RT-safe.
  void skip_reports(std::uint32_t count) noexcept { sequence_ += count; }

  /// Processes a command that arrives at `now`. Returns false if it is invalid, repeated or out of order;
  /// such a command has no effect and does not feed the watchdog. RT-safe.
  bool take_command(TimePoint now, std::span<const std::uint8_t> bytes) noexcept;
  /// Returns the wrench that the motors apply until the given time. Trips the watchdog if the hold time of
  /// the command ends before. RT-safe.
  Wrench motor_wrench(TimePoint until) noexcept;
  /// Switches the motors off and sets watchdog_tripped. RT-safe.
  void trip_watchdog() noexcept;

  // Faults of a firmware, for tests.
  /// If false, the watchdog never trips. RT-safe.
  void set_watchdog_enabled(bool awake) noexcept { watchdog_enabled_ = awake; }
  /// Switches the motors off without tripping the watchdog. RT-safe.
  void switch_motors_off() noexcept {
    motors_on_ = false;
    command_ = {};
  }

  bool motors_on() const noexcept { return motors_on_; }
  bool watchdog_tripped() const noexcept { return watchdog_tripped_; }

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
  double filter_gain_;  ///< weight of a new difference in the velocity estimate

  Encoder encoder_{};
  Twist V_BH_;  ///< velocity estimate
  std::uint64_t sequence_ = 0;

  Wrench command_;
  TimePoint hold_until_{};
  std::optional<std::uint64_t> last_command_;  ///< sequence of the last accepted command
  bool motors_on_ = false;
  bool watchdog_tripped_ = false;
  bool watchdog_enabled_ = true;
};

}  // namespace wrenchd
