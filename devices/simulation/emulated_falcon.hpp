// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "devices/falcon_start.hpp"
#include "devices/simulation/emulated_arm.hpp"

namespace wrenchd {

/// Emulated Novint Falcon: an FTDI serial chip and a boot loader that answers a handshake, echoes the
/// firmware as it receives it, and then runs it. The running firmware answers each packet of 16 bytes with 16
/// bytes at the next USB frame: encoders, buttons and homing state, as nibbles from 'A' on. The encoders are
/// incremental: they start at the power-on pose until the host requests homing mode and the user pulls the
/// handle out and pushes it in. The packet functions are RT-safe. The functions of the serial chip and
/// start() are not: they allocate.
class EmulatedFalcon final : public EmulatedArm, public SerialChip {
 public:
  enum class State : std::uint8_t { off, awaiting_handshake, loading, running };
  /// Maximum motor effort [motor counts].
  static constexpr int kMaxEffort = 4096;

  // Serial chip, as used by falcon_start().
  void control(std::uint8_t request, std::uint16_t value) override;
  void write(std::span<const std::uint8_t> bytes) override;
  std::vector<std::uint8_t> read(std::size_t most) override;

  /// Puts the device into the state after a successful start.
  void run() noexcept { state_ = State::running; }
  /// Sets the counts from the zero of the kinematics.
  void set_true_counts(const std::array<int, 3>& counts) noexcept { true_counts_ = counts; }
  /// Sets the true counts at power-on. The encoders report counts relative to them until they are homed.
  void set_power_on_counts(const std::array<int, 3>& counts) noexcept { power_on_counts_ = counts; }
  /// Pulls the handle out and pushes it in. In homing mode this homes the encoders.
  void perform_homing_motion() noexcept;
  void set_buttons(unsigned buttons) noexcept { buttons_ = buttons & 0x0fu; }

  // Faults; the argument is the number of affected packets, blocks or handshakes.
  /// Truncates packets to 14 bytes.
  void truncate_packets(int packets) noexcept { packets_to_truncate_ = packets; }
  /// Inverts a bit in the echoes of firmware blocks.
  void corrupt_firmware_echoes(int blocks) noexcept { echoes_to_corrupt_ = blocks; }
  void ignore_handshakes(int times) noexcept { handshakes_to_ignore_ = times; }

  void advance_to(TimePoint t, ReportSink& host) noexcept override;
  bool take_command(TimePoint now, std::span<const std::uint8_t> bytes) noexcept override;
  TimePoint next_event() const noexcept override { return next_frame_; }

  void set_counts(const JointCounts& counts) noexcept override;
  MotorEfforts motor_efforts() const noexcept override;  ///< motor efforts [motor counts]
  /// Performs the handshake and loads a placeholder, because the real firmware belongs to the manufacturer.
  /// Does nothing if a firmware already runs.
  void start() override;
  bool homing_requested() const noexcept override { return homing_ && !homed_; }
  void perform_homing() noexcept override { perform_homing_motion(); }

  State state() const noexcept { return state_; }
  bool homed() const noexcept { return homed_; }
  const std::array<int, 3>& efforts() const noexcept { return efforts_; }
  const std::vector<std::uint8_t>& firmware() const noexcept { return firmware_; }

 private:
  void take_serial(std::uint8_t byte);
  std::array<std::uint8_t, 16> packet() const noexcept;
  void send(ReportSink& host) noexcept;

  State state_ = State::off;
  std::uint16_t divisor_ = 0;
  bool dtr_ = false;
  std::vector<std::uint8_t> firmware_;
  std::vector<std::uint8_t> handshake_bytes_;  ///< received bytes of the handshake
  std::vector<std::uint8_t> reply_bytes_;      ///< bytes that the host has not read yet
  int echoes_to_corrupt_ = 0, handshakes_to_ignore_ = 0, packets_to_truncate_ = 0;

  bool powered_ = false;
  TimePoint next_frame_{};
  bool reply_due_ = false;
  std::array<int, 3> true_counts_{}, power_on_counts_{}, efforts_{};
  bool homing_ = false, homed_ = false;
  unsigned buttons_ = 0;
};

}  // namespace wrenchd
