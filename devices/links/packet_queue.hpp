// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/clock.hpp"
#include "devices/report_frame.hpp"

namespace wrenchd {

/// One report in transit.
struct Packet {
  /// Capacity in bytes: one more than the longest valid report, so that a too long report is detectable.
  static constexpr std::size_t kMaxBytes = kMaxReportBytes + 1;
  std::array<std::uint8_t, kMaxBytes> bytes{};
  std::size_t length = 0;
  TimePoint arrives{};

  std::span<const std::uint8_t> report() const noexcept { return std::span(bytes).first(length); }
};

/// Queue of reports in transit or waiting, oldest first. Its capacity is that of a Linux hidraw reader; when
/// it is full, it rejects the newest report. All members are RT-safe.
class PacketQueue {
 public:
  static constexpr std::size_t kCapacity = 64;

  /// Adds a report. Returns false and changes nothing if the queue is full or the report is too long.
  /// RT-safe.
  bool push(TimePoint arrives, std::span<const std::uint8_t> report) noexcept {
    if (count_ == kCapacity || report.size() > Packet::kMaxBytes) return false;
    Packet& packet = packets_[(first_ + count_++) % kCapacity];
    std::copy(report.begin(), report.end(), packet.bytes.begin());
    packet.length = report.size();
    packet.arrives = arrives;
    return true;
  }

  /// Returns the oldest packet if it has arrived at `now`, else nullptr. The pointer is valid until the next
  /// pop() or push(). RT-safe.
  const Packet* front_if_arrived(TimePoint now) const noexcept {
    return count_ > 0 && packets_[first_].arrives <= now ? &packets_[first_] : nullptr;
  }
  void pop() noexcept {
    first_ = (first_ + 1) % kCapacity;
    --count_;
  }
  void clear() noexcept { count_ = 0; }
  bool empty() const noexcept { return count_ == 0; }
  /// Returns the arrival time of the oldest packet. The queue must not be empty. RT-safe.
  TimePoint next_arrival() const noexcept { return packets_[first_].arrives; }

 private:
  std::array<Packet, kCapacity> packets_{};
  std::size_t first_ = 0;
  std::size_t count_ = 0;
};

}  // namespace wrenchd
