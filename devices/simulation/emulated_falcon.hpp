// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "devices/falcon_start.hpp"
#include "devices/simulation/emulated_arm.hpp"

namespace wrenchd {

/// A Novint Falcon: an FTDI serial chip with a loader behind it, which answers a handshake, echoes a firmware
/// as it takes it, and then runs it. Running, it sends 16 bytes at the next USB frame for every 16 it takes:
/// encoders, buttons and homing as nibbles from 'A' on. Its encoders count from wherever the handle was,
/// until homing mode is asked for and the handle is pulled out and pushed in. Packets are RT safe; starting
/// is not.
class EmulatedFalcon final : public EmulatedArm, public SerialChip {
 public:
  enum class State : std::uint8_t { off, awaiting_handshake, loading, running };
  /// What a motor takes at most, in its own counts.
  static constexpr int kMaxEffort = 4096;

  // The serial chip, as falcon_start() speaks to it.
  void control(std::uint8_t request, std::uint16_t value) override;
  void write(std::span<const std::uint8_t> bytes) override;
  std::vector<std::uint8_t> read(std::size_t most) override;

  /// As after a start that went well.
  void run() noexcept { state_ = State::running; }
  /// What the encoders would count from the zero of the kinematics.
  void set_true_counts(const std::array<int, 3>& counts) noexcept { true_counts_ = counts; }
  /// Where the counting began: they say so much less until they are homed.
  void set_power_on_counts(const std::array<int, 3>& counts) noexcept { power_on_counts_ = counts; }
  /// The hand pulls the handle out and pushes it in: in homing mode the encoders then know where they are.
  void perform_homing_motion() noexcept;
  void set_buttons(unsigned buttons) noexcept { buttons_ = buttons & 0x0fu; }

  // Faults, of the next so many:
  void truncate_packets(int packets) noexcept { packets_to_truncate_ = packets; }  ///< packets of 14 bytes
  void corrupt_firmware_echoes(int blocks) noexcept {
    echoes_to_corrupt_ = blocks;
  }  ///< echoes with a wrong byte
  void ignore_handshakes(int times) noexcept { handshakes_to_ignore_ = times; }

  void advance_to(TimePoint t, ReportSink& host) noexcept override;
  bool take_command(TimePoint now, std::span<const std::uint8_t> bytes) noexcept override;
  TimePoint next_event() const noexcept override { return next_frame_; }

  void set_counts(const JointCounts& counts) noexcept override;
  MotorEfforts motor_efforts() const noexcept override;  ///< [motor counts]
  /// Handshake and loading, with something in place of the firmware, which is its maker's. Nothing where one
  /// runs already.
  void start() override;
  bool homing_requested() const noexcept override { return homing_ && !homed_; }
  void perform_homing() noexcept override { perform_homing_motion(); }

  State state() const noexcept { return state_; }
  bool homed() const noexcept { return homed_; }
  unsigned lights() const noexcept { return lights_; }  ///< bits 1 to 3: green, blue, red
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
  std::vector<std::uint8_t> handshake_bytes_;  ///< of the handshake
  std::vector<std::uint8_t> reply_bytes_;      ///< waiting to be read
  int echoes_to_corrupt_ = 0, handshakes_to_ignore_ = 0, packets_to_truncate_ = 0;

  bool powered_ = false;
  TimePoint next_frame_{};
  bool reply_due_ = false;
  std::array<int, 3> true_counts_{}, power_on_counts_{}, efforts_{};
  bool homing_ = false, homed_ = false;
  unsigned buttons_ = 0, lights_ = 0;
};

}  // namespace wrenchd
