// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>

#include "devices/report_codec.hpp"
#include "devices/simulation/emulated_arm.hpp"

namespace wrenchd {

/// The board of Polhem and WoodenHaptics (haptikfabrikenapi, firmware/main.cpp): six encoder counters out,
/// three currents in, nothing of what they move. It sends one report when it is switched on, and then one for
/// each that it takes, at the next USB frame. Half a second after the last one its amplifiers are disabled.
/// RT safe.
class EmulatedPolhem final : public EmulatedArm {
 public:
  static constexpr Duration kWatchdog = std::chrono::milliseconds(500);

  /// report_bytes: 64 for the Teensy build, 14 for that of the LPC1768.
  explicit EmulatedPolhem(std::size_t report_bytes) : report_bytes_(report_bytes) {}

  /// The hand turns the encoders: what they count since power-on, a to f.
  void set_encoder_counts(const std::array<int, 6>& counts) noexcept { encoder_counts_ = counts; }
  /// The button on the handle, which the host finds in encoder d, and the one on the board.
  void set_handle_button(bool pressed) noexcept { handle_button_ = pressed; }
  void press_calibration_button() noexcept { calibration_button_ = true; }

  void advance_to(TimePoint t, ReportSink& host) noexcept override;
  bool take_command(TimePoint now, std::span<const std::uint8_t> bytes) noexcept override;
  TimePoint next_event() const noexcept override { return next_frame_; }

  void set_counts(const JointCounts& counts) noexcept override;
  MotorEfforts motor_efforts() const noexcept override;  ///< [A]

  bool amplifiers_on() const noexcept { return amplifiers_on_; }
  const std::array<int, 3>& currents_mA() const noexcept { return currents_mA_; }  ///< 0 while they are off
  std::uint64_t reports_sent() const noexcept { return reports_sent_; }

 private:
  void send(ReportSink& host) noexcept;

  std::size_t report_bytes_;
  bool powered_ = false;
  bool reply_due_ = false;  ///< it has been spoken to since the last report
  TimePoint next_frame_{};  ///< USB asks once a millisecond
  TimePoint last_command_at_{};
  std::array<int, 6> encoder_counts_{};
  std::array<int, 6> counter_offsets_{};  ///< counters are set by command 1
  std::array<int, 3> currents_mA_{};
  bool amplifiers_on_ = false;
  bool handle_button_ = false, calibration_button_ = false;
  std::uint64_t reports_sent_ = 0;
};

}  // namespace wrenchd
