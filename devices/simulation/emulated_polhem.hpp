// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>

#include "devices/report_codec.hpp"
#include "devices/simulation/emulated_arm.hpp"

namespace wrenchd {

/// Emulated controller board of Polhem and WoodenHaptics (haptikfabrikenapi, firmware/main.cpp). It sends six
/// encoder counts and accepts three motor currents; it does not know the kinematics. It sends one report at
/// power-on and one for each accepted report, at the next USB frame. It disables its amplifiers half a second
/// after the last report. All members are RT-safe.
class EmulatedPolhem final : public EmulatedArm {
 public:
  static constexpr Duration kWatchdog = std::chrono::milliseconds(500);

  /// report_bytes: 64 for the Teensy build, 14 for the LPC1768 build.
  explicit EmulatedPolhem(std::size_t report_bytes) : report_bytes_(report_bytes) {}

  /// Sets the counts of the encoders a to f since power-on.
  void set_encoder_counts(const std::array<int, 6>& counts) noexcept { encoder_counts_ = counts; }
  /// Sets the handle button, which the host reads in encoder d. press_calibration_button() presses the button
  /// on the board.
  void set_handle_button(bool pressed) noexcept { handle_button_ = pressed; }
  void press_calibration_button() noexcept { calibration_button_ = true; }

  void advance_to(TimePoint t, ReportSink& host) noexcept override;
  bool take_command(TimePoint now, std::span<const std::uint8_t> bytes) noexcept override;
  TimePoint next_event() const noexcept override { return next_frame_; }

  void set_counts(const JointCounts& counts) noexcept override;
  MotorEfforts motor_efforts() const noexcept override;  ///< motor currents [A]

  bool amplifiers_on() const noexcept { return amplifiers_on_; }
  /// Commanded currents; 0 while the amplifiers are off.
  const std::array<int, 3>& currents_mA() const noexcept { return currents_mA_; }
  std::uint64_t reports_sent() const noexcept { return reports_sent_; }

 private:
  void send(ReportSink& host) noexcept;

  std::size_t report_bytes_;
  bool powered_ = false;
  bool reply_due_ = false;  ///< true if a command arrived since the last report
  TimePoint next_frame_{};  ///< next USB frame; one per millisecond
  TimePoint last_command_at_{};
  std::array<int, 6> encoder_counts_{};
  std::array<int, 6> counter_offsets_{};  ///< offsets of the counters, set by command 1
  std::array<int, 3> currents_mA_{};
  bool amplifiers_on_ = false;
  bool handle_button_ = false, calibration_button_ = false;
  std::uint64_t reports_sent_ = 0;
};

}  // namespace wrenchd
