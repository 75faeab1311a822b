// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <span>

#include "devices/links/packet_queue.hpp"
#include "devices/links/report_link.hpp"

namespace wrenchd::test {

/// A link in memory: the test queues reports with arrive(), and take_command() receives the commands.
class MemoryLink : public ReportLink {
 public:
  LinkStatus reading = LinkStatus::ok;  ///< Status of reads; disconnected: the device is unplugged.
  LinkStatus writing = LinkStatus::ok;  ///< Status of writes.

  /// Queues a report. Returns false if the queue is full or the report is too long.
  bool arrive(TimePoint now, std::span<const std::uint8_t> report) noexcept {
    return waiting_.push(now, report);
  }

  void open() override {
    waiting_.clear();
    reading = writing = LinkStatus::ok;
  }
  LinkRead read(TimePoint now, std::span<std::uint8_t> buffer) noexcept override {
    if (reading != LinkStatus::ok) return {reading, 0, now};
    const Packet* packet = waiting_.front_if_arrived(now);
    if (packet == nullptr) return {LinkStatus::not_ready, 0, now};
    const auto bytes = packet->report().first(std::min(packet->length, buffer.size()));
    std::copy(bytes.begin(), bytes.end(), buffer.begin());
    const LinkRead read{LinkStatus::ok, packet->length, packet->arrives};
    waiting_.pop();
    return read;
  }
  LinkStatus write(TimePoint, std::span<const std::uint8_t> report) noexcept override {
    if (writing == LinkStatus::ok) take_command(report);
    return writing;
  }
  void wait_readable(TimePoint) noexcept override {}
  void close() noexcept override {}

 protected:
  virtual void take_command(std::span<const std::uint8_t>) noexcept {}

 private:
  PacketQueue waiting_;
};

}  // namespace wrenchd::test
