// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <span>

#include "core/clock.hpp"
#include "core/latest_value.hpp"
#include "devices/links/packet_queue.hpp"
#include "devices/links/report_link.hpp"

namespace wrenchd {

/// Room for one report between the servo thread and a writer that may be slow. A newer report takes the place
/// of one that is not yet being written; none waits behind another. Whether the writer is stuck is found by
/// the clock on the servo thread's side, so that a writer that never comes back is found as well.
///
/// Nothing here waits, locks or allocates: RT safe on both sides.
class WriteSlot {
 public:
  /// `deadline`: how long a report may wait without any write coming to its end.
  explicit WriteSlot(Duration deadline) noexcept : deadline_(deadline) {}

  // --- by the servo thread ---

  /// Puts the report into the slot.
  ///   ok     it is the next one to be written
  ///   empty  likewise, but the writer is overdue, or a write failed since the last report; or the report is
  ///          longer than any report may be, and was not taken
  ///   gone   the device is not there any more; the report was not taken
  LinkStatus submit(TimePoint now, std::span<const std::uint8_t> report) noexcept;
  /// A report waits, and no write ended for longer than the deadline.
  bool overdue(TimePoint now) const noexcept;

  // --- by the writer ---

  /// The newest report, if there is one that was not taken yet. Each one taken must be ended.
  bool take(Packet& packet) noexcept;
  /// The report taken last was written (ok), could not be (empty), or there is nobody to write to (gone).
  void complete(LinkStatus status) noexcept;

  // --- by anybody ---

  bool disconnected() const noexcept { return disconnected_.load(std::memory_order_relaxed); }
  std::uint64_t written() const noexcept { return written_.load(std::memory_order_relaxed); }
  std::uint64_t failed() const noexcept { return failed_.load(std::memory_order_relaxed); }
  /// Reports that a newer one took the place of.
  std::uint64_t replaced() const noexcept { return replaced_.load(std::memory_order_relaxed); }

 private:
  struct Numbered {
    Packet packet;
    std::uint64_t number = 0;
  };

  Duration deadline_;
  LatestValue<Numbered> slot_;

  // The servo thread's.
  std::uint64_t submitted_ = 0;       ///< number of the last report handed over
  std::uint64_t completed_seen_ = 0;  ///< what completed_ was when progress was last seen
  std::uint64_t failed_seen_ = 0;     ///< failures already told
  TimePoint waiting_since_{};         ///< when there was last progress, or nothing waiting

  // The writer's.
  std::uint64_t taken_ = 0;

  std::atomic<std::uint64_t> completed_{0};  ///< number of the last report whose write came to an end
  std::atomic<std::uint64_t> written_{0};
  std::atomic<std::uint64_t> failed_{0};
  std::atomic<std::uint64_t> replaced_{0};
  std::atomic<bool> disconnected_{false};
};

}  // namespace wrenchd
