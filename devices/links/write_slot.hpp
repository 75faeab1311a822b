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

/// Slot for one report between the servo thread and a writer that may be slow. A newer report replaces one
/// that is not yet being written; reports never queue. The servo thread detects a stuck writer by the clock,
/// also if the writer never returns.
///
/// All members are RT-safe on both sides: they do not wait, lock or allocate.
class WriteSlot {
 public:
  /// `deadline`: maximum time that a report may wait without the completion of any write.
  explicit WriteSlot(Duration deadline) noexcept : deadline_(deadline) {}

  // --- called by the servo thread ---

  /// Puts the report into the slot.
  ///
  ///   ok             the report is the next one to be written
  ///   not_ready      the report is in the slot, but the writer is overdue or a write failed since the last
  ///                  report; or the report is too long and was rejected
  ///   disconnected   the device is disconnected; the report was rejected
  ///
  /// RT-safe.
  LinkStatus submit(TimePoint now, std::span<const std::uint8_t> report) noexcept;
  /// Returns true if a report waits and no write has completed for longer than the deadline. RT-safe.
  bool overdue(TimePoint now) const noexcept;

  // --- called by the writer ---

  /// Takes the newest report, if there is one that was not taken yet. Call complete() after each take().
  /// RT-safe.
  bool take(Packet& packet) noexcept;
  /// Reports the result of the last taken report: written (ok), failed (not_ready), or no device
  /// (disconnected). RT-safe.
  void complete(LinkStatus status) noexcept;

  // --- called by any thread ---

  bool disconnected() const noexcept { return disconnected_.load(std::memory_order_relaxed); }
  std::uint64_t written() const noexcept { return written_.load(std::memory_order_relaxed); }
  std::uint64_t failed() const noexcept { return failed_.load(std::memory_order_relaxed); }
  /// Number of reports that were replaced by a newer one.
  std::uint64_t replaced() const noexcept { return replaced_.load(std::memory_order_relaxed); }

 private:
  struct Numbered {
    Packet packet;
    std::uint64_t number = 0;
  };

  Duration deadline_;
  LatestValue<Numbered> slot_;

  // Used by the servo thread only.
  std::uint64_t submitted_ = 0;       ///< number of the last submitted report
  std::uint64_t completed_seen_ = 0;  ///< value of completed_ when progress was last observed
  std::uint64_t failed_seen_ = 0;     ///< failures already reported
  TimePoint waiting_since_{};  ///< time of the last progress, or of the last time with no report waiting

  // Used by the writer only.
  std::uint64_t taken_ = 0;

  std::atomic<std::uint64_t> completed_{0};  ///< number of the last report whose write completed
  std::atomic<std::uint64_t> written_{0};
  std::atomic<std::uint64_t> failed_{0};
  std::atomic<std::uint64_t> replaced_{0};
  std::atomic<bool> disconnected_{false};
};

}  // namespace wrenchd
