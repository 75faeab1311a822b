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

/// Simulated defect of the device from now on.
enum class Trouble : std::uint8_t {
  none,
  short_reports,  ///< the first half of each report
  garbled,        ///< one wrong bit in each report
  duplicates,     ///< each report twice
  frozen,         ///< repeats one report with its sequence number
  silent,         ///< no reports; sequence numbers continue
  stalled_once,   ///< the IN endpoint halts until the host clears it; then it works again
  stalled,        ///< it halts, and clearing has no effect
  blocked,        ///< NAKs its OUT endpoint: a command is neither accepted nor rejected
};

/// Observations of the device, to compare with those of the host.
struct DeviceRecord {
  std::uint64_t made = 0;         ///< number of pose reports
  std::uint64_t sent = 0;         ///< number of transfers answered with a pose report
  std::uint64_t unprepared = 0;   ///< reports without a pending transfer of the host
  std::uint64_t late_ticks = 0;   ///< late ticks of the device itself: the machine is too slow for the test
  std::uint64_t out_reports = 0;  ///< number of written reports, valid or not, by both paths
  std::uint64_t commands = 0;     ///< commands that the firmware accepted
  std::uint64_t rejected = 0;     ///< commands that the firmware rejected
  std::uint64_t halts_cleared = 0;
  bool motors_on = false;
  bool watchdog_tripped = false;
  WrenchReport last;        ///< last valid command
  std::size_t answers = 0;  ///< number of commands with the motors on, and of turn_arounds()
};

/// A device as in devices/README.md, connected to this machine, with the simulated firmware. High speed,
/// bInterval 1.
///
/// The handle moves along x: position_m() of each sequence number. The force in x
/// of a command encodes the pose that it answers: 1 uN per sequence number.
class UsbipDevice final : public UsbipPort {
 public:
  using Identity = UsbIdentity;

  /// `priority`: SCHED_FIFO, of the device's own thread.
  UsbipDevice(Identity identity, double rate_Hz, int priority);
  ~UsbipDevice();

  void set(Trouble trouble);
  DeviceRecord record() const;
  /// Times from each transmitted pose to the command that answers it.
  std::vector<Duration> turn_arounds() const;

  static double position_m(std::uint64_t sequence) noexcept;
  static Wrench answer_to(std::uint64_t sequence) noexcept;

 private:
  /// Reports that wait for a transfer of the host.
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

  // Protected by mutex_.
  Trouble trouble_ = Trouble::none;
  DeviceRecord record_;
  std::vector<Duration> turn_arounds_;
  bool halted_ = false;
  std::deque<Outgoing> outbox_;
  Outgoing newest_;
  std::array<TimePoint, 1024> sent_at_{};
  TimePoint powered_{};
  TimePoint next_{};  ///< time of the next report
};

}  // namespace wrenchd::test
