// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/clock.hpp"
#include "core/simulation_settings.hpp"
#include "devices/links/packet_queue.hpp"
#include "devices/links/report_link.hpp"
#include "devices/simulation/emulated_device.hpp"

namespace wrenchd {

/// Link to an emulated device: a delay and a queue in each direction, and transport faults. Reports wait in a
/// ring of 64, as with hidraw; if the ring is full, the link drops the newest report.
///
/// The time of the device advances only in calls of this link, up to their `now`. The link has no thread.
class LoopbackLink final : public ReportLink, private ReportSink {
 public:
  /// Uses the delays of the settings. Device and clock must outlive the link.
  LoopbackLink(EmulatedDevice& device, Clock& clock, const SimulationSettings& settings);
  /// Uses no delay: a command has arrived when write() returns.
  LoopbackLink(EmulatedDevice& device, Clock& clock) : device_(device), clock_(clock) {}

  /// Throws std::runtime_error while the device is unplugged. Not RT-safe: may throw.
  void open() override;
  LinkRead read(TimePoint now, std::span<std::uint8_t> buffer) noexcept override;
  LinkStatus write(TimePoint now, std::span<const std::uint8_t> report) noexcept override;
  void wait_readable(TimePoint deadline) noexcept override;
  void close() noexcept override;

  /// Advances the time without a read or write, also while the link is closed: commands arrive and reports
  /// enter the queue. RT-safe.
  void advance_to(TimePoint now) noexcept;
  /// Number of reports lost because the host did not read them in time. RT-safe.
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
  TimePoint unplug_checked_until_{};  ///< time up to which unplug faults have been checked
  PacketQueue reports_;               ///< reports from device to host
  PacketQueue commands_;              ///< commands from host to device
  Packet last_report_;                ///< last report that the device sent outside a freeze fault
  Packet swapped_report_;             ///< report that a swap fault sends after its successor
  std::uint64_t reports_sent_ = 0;
  TimePoint last_arrival_{};
  std::uint64_t dropped_ = 0;
};

}  // namespace wrenchd
