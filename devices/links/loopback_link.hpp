// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/clock.hpp"
#include "core/simulation_settings.hpp"
#include "devices/links/packet_queue.hpp"
#include "devices/links/report_link.hpp"
#include "devices/simulation/emulated_device.hpp"

namespace wrenchd {

/// The wire to an emulated device: a delay and a queue in each direction, and the faults that a wire has.
/// Reports wait in a ring like that of hidraw: 64 of them, and a newer one is dropped when it is full.
///
/// Time passes for the device only in these calls, up to the `now` they are given; nothing runs in between
/// and there is no thread.
class LoopbackLink final : public ReportLink, private ReportSink {
 public:
  /// The delays are those of the settings. Device and clock must outlive the link.
  LoopbackLink(EmulatedDevice& device, Clock& clock, const SimulationSettings& settings);
  /// No delay: what is written has arrived when write() returns.
  LoopbackLink(EmulatedDevice& device, Clock& clock) : device_(device), clock_(clock) {}

  /// Throws std::runtime_error while the device is unplugged.
  void open() override;
  LinkRead read(TimePoint now, std::span<std::uint8_t> buffer) noexcept override;
  LinkStatus write(TimePoint now, std::span<const std::uint8_t> report) noexcept override;
  void wait_readable(TimePoint deadline) noexcept override;
  void close() noexcept override;

  /// Lets time pass without a read or write, open or not: commands arrive, reports queue up. RT safe.
  void advance_to(TimePoint now) noexcept;
  /// Reports lost because the host did not read them in time.
  std::uint64_t dropped() const noexcept { return dropped_; }

 private:
  enum class State : std::uint8_t { closed, open, disconnected };

  void take_report(TimePoint sent, std::span<const std::uint8_t> report) noexcept override;
  void enqueue(TimePoint arrives, const Packet& packet) noexcept;
  void block_if_stalled() noexcept;
  TimePoint next_arrival(TimePoint now) const noexcept;

  EmulatedDevice& device_;
  Clock& clock_;
  Duration report_delay_{};
  Duration command_delay_{};
  State state_ = State::closed;
  TimePoint unplug_checked_until_{};  ///< time up to which unplugging has been looked for
  PacketQueue reports_;               ///< device to host
  PacketQueue commands_;              ///< host to device
  Packet last_report_;                ///< that left the device and was not frozen
  Packet swapped_report_;             ///< that waits for the one which follows it
  std::uint64_t reports_sent_ = 0;
  TimePoint last_arrival_{};
  std::uint64_t dropped_ = 0;
};

}  // namespace wrenchd
