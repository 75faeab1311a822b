// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/clock.hpp"
#include "devices/packet_queue.hpp"
#include "devices/report_link.hpp"
#include "devices/simulated_device.hpp"

namespace wrenchd {

/// The far end of a real device's protocol: what its firmware does, as far as a host can see it. It knows no
/// wrenchd: only bytes, time, and what a hand does with it. Everything here is RT safe.
class EmulatedDevice {
 public:
  virtual ~EmulatedDevice() = default;

  /// Lets time pass, up to t. The first call switches the power on.
  virtual void advance_to(TimePoint t, ReportSink& host) noexcept = 0;
  /// A report of the host arrives, now. False where the firmware ignores it.
  virtual bool take_command(TimePoint now, std::span<const std::uint8_t> bytes) noexcept = 0;
  /// When there is something to do next, as far as that is known.
  virtual TimePoint next_event() const noexcept = 0;
};

/// The wire to an emulated device: no delay, and a ring of 64 reports like that of hidraw. Time passes for
/// the device only in these calls.
class EmulatedLink final : public ReportLink, private ReportSink {
 public:
  /// Both must outlive the link.
  EmulatedLink(EmulatedDevice& device, Clock& clock) : device_(device), clock_(clock) {}

  /// Throws std::runtime_error while the device is unplugged.
  void open() override;
  LinkRead read(TimePoint now, std::span<std::uint8_t> buffer) noexcept override;
  LinkStatus write(TimePoint now, std::span<const std::uint8_t> report) noexcept override;
  void wait_readable(TimePoint deadline) noexcept override;
  void close() noexcept override;

  /// Gone, until plug(): reads and writes say so, and what waited is lost. RT safe.
  void unplug() noexcept { plugged_ = open_ = false; }
  void plug() noexcept { plugged_ = true; }
  /// Reports lost because the host did not read them in time.
  std::uint64_t dropped() const noexcept { return dropped_; }

 private:
  void take_report(TimePoint sent, std::span<const std::uint8_t> report) noexcept override;

  EmulatedDevice& device_;
  Clock& clock_;
  bool plugged_ = true;
  bool open_ = false;
  PacketQueue reports_;
  std::uint64_t dropped_ = 0;
};

}  // namespace wrenchd
