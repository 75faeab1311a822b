// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/clock.hpp"
#include "devices/report_codec.hpp"

namespace wrenchd {

/// One report on its way.
struct Packet {
  /// A byte more than a report may have, for one that is too long.
  static constexpr std::size_t kMaxBytes = kMaxReportBytes + 1;
  std::array<std::uint8_t, kMaxBytes> bytes{};
  std::size_t length = 0;
  TimePoint arrives{};

  std::span<const std::uint8_t> report() const noexcept { return std::span(bytes).first(length); }
};

/// Reports in flight or waiting, oldest first. Holds as many as the ring of a Linux hidraw reader, and like
/// it refuses the newest when it is full. RT safe.
class PacketQueue {
 public:
  static constexpr std::size_t kCapacity = 64;

  /// False, and nothing changes, where the queue is full or the report too long.
  bool push(TimePoint arrives, std::span<const std::uint8_t> report) noexcept {
    if (count_ == kCapacity || report.size() > Packet::kMaxBytes) return false;
    Packet& packet = packets_[(first_ + count_++) % kCapacity];
    std::copy(report.begin(), report.end(), packet.bytes.begin());
    packet.length = report.size();
    packet.arrives = arrives;
    return true;
  }

  /// The oldest packet if it has arrived by now, or nullptr. Valid until the next pop() or push().
  const Packet* front_if_arrived(TimePoint now) const noexcept {
    return count_ > 0 && packets_[first_].arrives <= now ? &packets_[first_] : nullptr;
  }
  void pop() noexcept {
    first_ = (first_ + 1) % kCapacity;
    --count_;
  }
  void clear() noexcept { count_ = 0; }
  bool empty() const noexcept { return count_ == 0; }
  /// When the oldest packet arrives; ask only where there is one.
  TimePoint next_arrival() const noexcept { return packets_[first_].arrives; }

 private:
  std::array<Packet, kCapacity> packets_{};
  std::size_t first_ = 0;
  std::size_t count_ = 0;
};

}  // namespace wrenchd
