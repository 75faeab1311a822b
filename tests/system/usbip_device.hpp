// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "devices/report_codec.hpp"
#include "devices/simulation/simulated_firmware.hpp"
#include "tests/system/usbip_port.hpp"

namespace wrenchd::test {

/// What a device does wrong from now on.
enum class Trouble : std::uint8_t {
  none,
  short_reports,  ///< the first half of each report
  garbled,        ///< one wrong bit in each report
  duplicates,     ///< each report twice
  frozen,         ///< one report again and again, sequence and all
  silent,         ///< no reports; poses are taken all the same, so that their numbers go on
  stalled_once,   ///< the IN endpoint halts until the host clears it; then it works again
  stalled,        ///< it halts, and clearing does not help
  deaf,           ///< NAKs its OUT endpoint: a command is neither taken nor rejected
};

/// What the far side saw: the truth that the host is held against.
struct DeviceRecord {
  std::uint64_t made = 0;         ///< pose reports
  std::uint64_t sent = 0;         ///< transfers answered with one
  std::uint64_t unprepared = 0;   ///< reports that found no transfer of the host's waiting
  std::uint64_t late_ticks = 0;   ///< of the device itself: then the machine is too slow for the test
  std::uint64_t out_reports = 0;  ///< everything written to it, good or bad, by either way
  std::uint64_t commands = 0;     ///< commands its firmware took
  std::uint64_t rejected = 0;     ///< commands its firmware did not take
  std::uint64_t halts_cleared = 0;
  bool motors_on = false;
  bool watchdog_tripped = false;
  WrenchReport last;        ///< the last command that was one
  std::size_t answers = 0;  ///< commands with the motors on: turn_arounds() so far
};

/// A device that follows devices/README.md, plugged into this machine: its firmware is the simulated one.
/// High speed, bInterval 1.
///
/// The handle moves along x: position_m() of each sequence number. A command tells by its force in x which
/// pose it answers: one micronewton for each count of its sequence.
class UsbipDevice final : public UsbipPort {
 public:
  using Identity = UsbIdentity;

  /// `priority`: SCHED_FIFO, of the device's own thread.
  UsbipDevice(Identity identity, double rate_Hz, int priority);
  ~UsbipDevice();

  void set(Trouble trouble);
  DeviceRecord record() const;
  /// From each pose on the wire to the command that answers it.
  std::vector<Duration> turn_arounds() const;

  static double position_m(std::uint64_t sequence) noexcept;
  static Wrench answer_to(std::uint64_t sequence) noexcept;

 private:
  /// What is to be sent to the host.
  struct Outgoing {
    Bytes bytes;
    std::uint32_t sequence = 0;
  };

  TimePoint begin(TimePoint now) override;
  TimePoint on_time(TimePoint now) override;
  void on_in() override { flush(); }
  void on_out(Transfer transfer) override;
  void on_set_report(std::span<const std::uint8_t> data) override { take_command(data); }
  void on_clear_halt() override;

  void tick(std::uint64_t ticks, TimePoint now);
  void flush();
  void take_command(std::span<const std::uint8_t> data);
  void take_held_commands();

  Duration period_;
  DeviceProfile profile_;
  SimulatedFirmware firmware_;

  // Under mutex_.
  Trouble trouble_ = Trouble::none;
  DeviceRecord record_;
  std::vector<Duration> turn_arounds_;
  bool halted_ = false;
  std::deque<Outgoing> outbox_;
  Outgoing newest_;
  std::array<TimePoint, 1024> sent_at_{};
  TimePoint powered_{};
  TimePoint next_{};  ///< report
};

}  // namespace wrenchd::test
