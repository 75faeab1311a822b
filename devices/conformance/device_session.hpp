// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <stdexcept>
#include <vector>

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "core/spatial.hpp"
#include "devices/links/report_link.hpp"
#include "devices/report_codec.hpp"

namespace wrenchd {

/// One report as it arrived, valid or not.
struct ReceivedReport {
  TimePoint arrived{};
  std::vector<std::uint8_t> bytes;
  Decoding outcome = Decoding::ok;
  PoseReport content;          ///< default values if the outcome is not ok
  double device_time_s = 0.0;  ///< unwrapped; continues that of the previous valid report
};

/// One command as it was submitted to the link.
struct SentCommand {
  TimePoint sent{};
  std::uint64_t sequence = 0;  ///< raw
};

/// Error: the user cancelled the session.
class SessionCancelled : public std::runtime_error {
 public:
  SessionCancelled() : std::runtime_error("cancelled; the device was released") {}
};

/// Exchange of single reports with a device, without the checks of ProfileDevice: a tool sees every report,
/// valid or not, and may send commands that are wrong on purpose. The device is released on every way out:
/// release(), the destructor, and therefore each exception. Not RT-safe: waits and allocates.
class DeviceSession {
 public:
  /// Pause between two commands.
  static constexpr Duration kCommandPeriod = std::chrono::milliseconds(1);

  /// Opens the link and discards waiting reports. cancelled: returns true if the user cancelled the session.
  /// Throws as the link does. Profile, link and clock must outlive the session.
  DeviceSession(const DeviceProfile& profile, ReportLink& link, Clock& clock,
                std::function<bool()> cancelled);
  ~DeviceSession();
  DeviceSession(const DeviceSession&) = delete;
  DeviceSession& operator=(const DeviceSession&) = delete;

  /// Receives reports for this time. Throws SessionCancelled, and std::runtime_error if the device is
  /// disconnected.
  void listen(Duration time);
  /// Sends one command per kCommandPeriod for this time, with rising sequence, and receives reports.
  void drive(Duration time, bool enable, double hold_s, const Wrench& F = {});
  /// Sends one command with the next sequence, then receives reports for kCommandPeriod.
  void send(bool enable, double hold_s, const Wrench& F = {});
  /// Sends these bytes as they are, then receives reports for kCommandPeriod.
  void send_bytes(std::span<const std::uint8_t> bytes);
  /// Returns a command with the checksum. Sends nothing.
  std::vector<std::uint8_t> encoded(std::uint64_t sequence, bool enable, double hold_s,
                                    const Wrench& F = {}) const;
  /// Sends zero commands with the motors off, if any command was sent. Never throws.
  void release() noexcept;

  /// Reports and commands since the last clear().
  const std::vector<ReceivedReport>& reports() const noexcept { return reports_; }
  const std::vector<SentCommand>& commands() const noexcept { return commands_; }
  void clear() noexcept {
    reports_.clear();
    commands_.clear();
  }
  /// Returns the newest valid report; null if none arrived since the last clear().
  const ReceivedReport* newest() const noexcept;

  /// Sequence number of the last command.
  std::uint64_t sequence() const noexcept { return sequence_; }
  /// The next command has the following sequence number.
  void set_sequence(std::uint64_t sequence) noexcept { sequence_ = sequence & 0xFFFFU; }
  /// Number of commands that the link did not accept.
  int refused() const noexcept { return refused_; }

 private:
  void receive(TimePoint until);
  void take(const LinkRead& read, std::span<const std::uint8_t> bytes);
  void write(std::span<const std::uint8_t> bytes);

  const DeviceProfile& profile_;
  ReportLink& link_;
  Clock& clock_;
  std::function<bool()> cancelled_;
  std::vector<ReceivedReport> reports_;
  std::vector<SentCommand> commands_;
  bool time_known_ = false;
  std::uint64_t raw_time_ = 0;
  double device_time_s_ = 0.0;
  std::uint64_t sequence_ = 0;
  int refused_ = 0;
  bool driven_ = false;  ///< a command was sent since the last release
};

}  // namespace wrenchd
