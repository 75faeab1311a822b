// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "devices/report_codec.hpp"
#include "devices/simulated_firmware.hpp"

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
  deaf,           ///< NAKs its OUT endpoint: a command is neither taken nor refused
};

/// What the far side saw: the truth that the host is held against.
struct DeviceRecord {
  std::uint64_t made = 0;         ///< pose reports
  std::uint64_t sent = 0;         ///< transfers answered with one
  std::uint64_t unprepared = 0;   ///< reports that found no transfer of the host's waiting
  std::uint64_t late_ticks = 0;   ///< of the device itself: then the machine is too slow for the test
  std::uint64_t out_reports = 0;  ///< everything written to it, good or bad, by either way
  std::uint64_t commands = 0;     ///< commands its firmware took
  std::uint64_t refused = 0;      ///< commands its firmware did not take
  std::uint64_t halts_cleared = 0;
  bool motors_on = false;
  bool watchdog_tripped = false;
  WrenchReport last;        ///< the last command that was one
  std::size_t answers = 0;  ///< commands with the motors on: turn_arounds() so far
};

/// A device that follows devices/README.md, plugged into this machine: its firmware is the simulated one, and
/// it speaks USB/IP with the kernel's own virtual host controller (vhci_hcd), over a socket pair. Everything
/// above that controller is what a real device meets. High speed, bInterval 1.
///
/// The handle moves along x: position_m() of each sequence number. A command tells by its force in x which
/// pose it answers: one micronewton for each count of its sequence.
class UsbipDevice {
 public:
  struct Identity {
    std::uint16_t vendor = 0x1209;
    std::uint16_t product = 0x6d0f;
    std::string serial = "A1";
  };

  /// `priority`: SCHED_FIFO, of the device's own thread.
  UsbipDevice(Identity identity, double rate_Hz, int priority);
  ~UsbipDevice();
  UsbipDevice(const UsbipDevice&) = delete;
  UsbipDevice& operator=(const UsbipDevice&) = delete;

  /// Into that port of the virtual controller. Throws std::runtime_error where the port is taken or there is
  /// no controller.
  void plug(int port);
  void unplug();
  void set(Trouble trouble);
  DeviceRecord record() const;
  /// From each pose on the wire to the command that answers it.
  std::vector<Duration> turn_arounds() const;

  static double position_m(std::uint64_t sequence) noexcept;
  static Wrench answer_to(std::uint64_t sequence) noexcept;

 private:
  using Bytes = std::vector<std::uint8_t>;
  /// A transfer of the host's that waits for an answer.
  struct Transfer {
    std::uint32_t number = 0;
    std::uint32_t length = 0;
    Bytes data;  ///< what the host sends, where it does
  };
  /// What is to be sent to the host.
  struct Outgoing {
    Bytes bytes;
    std::uint32_t sequence = 0;
  };

  void run();
  void serve_host(bool& connected);
  std::size_t serve(std::span<const std::uint8_t> bytes);
  void submitted(std::uint32_t number, std::uint32_t direction, std::uint32_t endpoint, std::uint32_t length,
                 std::span<const std::uint8_t> setup, std::span<const std::uint8_t> data);
  void unlinked(std::uint32_t number, std::uint32_t unlink);
  void control(std::uint32_t number, std::span<const std::uint8_t> setup, std::span<const std::uint8_t> data);
  std::optional<Bytes> answer_control(std::span<const std::uint8_t> setup,
                                      std::span<const std::uint8_t> data);
  std::optional<Bytes> descriptor(unsigned type, unsigned index) const;

  void tick(std::uint64_t ticks, TimePoint now);
  void flush();
  void take_command(std::span<const std::uint8_t> data);
  void take_held_commands();

  void reply(std::uint32_t number, std::int32_t status, std::uint32_t length,
             std::span<const std::uint8_t> in);
  void send(std::span<const std::uint8_t> bytes) const;

  Identity identity_;
  double rate_Hz_;
  int priority_;
  DeviceProfile profile_;
  SimulatedFirmware firmware_;
  int port_ = -1;
  int socket_ = -1;
  std::thread thread_;
  std::array<std::uint8_t, 8192> received_{};  ///< from the host, and not yet understood
  std::size_t received_bytes_ = 0;
  std::atomic<bool> pulled_{false};

  mutable std::mutex mutex_;  ///< over all below
  Trouble trouble_ = Trouble::none;
  DeviceRecord record_;
  std::vector<Duration> turn_arounds_;
  bool halted_ = false;
  std::deque<Transfer> in_, held_out_;
  std::deque<Outgoing> outbox_;
  Outgoing newest_;
  std::array<TimePoint, 1024> sent_at_{};
  TimePoint powered_{};
};

}  // namespace wrenchd::test
