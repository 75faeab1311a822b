// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <vector>

#include "collision/touch.hpp"
#include "daemon/recording/recording_file.hpp"
#include "daemon/servo/shared_state.hpp"
#include "daemon/servo/tick_record.hpp"

namespace wrenchd {

/// A ring of the newest ticks with their contacts, in memory of fixed size. It serves the flight recorder,
/// and it buffers ticks for a slow disk. Records have consecutive numbers from 0. Any thread except the servo
/// thread. Not RT-safe: locks.
class RecordHistory {
 public:
  /// Capacity for contacts, as a mean over all ticks. If there are more contacts, the oldest ticks lose
  /// theirs.
  static constexpr std::size_t kContactsPerTick = 8;
  /// Memory for one tick [bytes].
  static constexpr std::size_t kBytesPerTick =
      sizeof(TickRecord) + sizeof(ContactRange) + kContactsPerTick * sizeof(Touch);

  /// Capacity for `ticks` ticks, at least one. Throws std::runtime_error if there is not enough memory.
  explicit RecordHistory(std::size_t ticks);

  void append(const StateRecord& record);

  /// Numbers of the oldest stored record (begin) and of the next record (end).
  struct RecordRange {
    std::uint64_t begin = 0;
    std::uint64_t end = 0;
  };
  RecordRange stored_range() const;
  /// Returns the number of the first stored record that began at this time [ns] or later; stored_range().end
  /// if there is none.
  std::uint64_t first_at_or_after(std::int64_t now_ns) const;
  /// Returns the number (TickRecord::tick) of the stored tick that was in progress at this time [ns]; -1 if
  /// none was.
  std::int64_t tick_at(std::int64_t now_ns) const;
  /// Returns when the newest tick began [ns]; 0 if the history is empty.
  std::int64_t newest_ns() const;

  /// Replaces the content of `out` by at most `most` records with numbers from `from` to `end` - 1. Starts
  /// later if the first of them are not stored any more. Returns the number of the first copied record.
  std::uint64_t copy(std::uint64_t from, std::uint64_t end, std::size_t most, RecordBatch& out) const;

 private:
  const TickRecord& tick(std::uint64_t number) const { return ticks_[number % ticks_.size()]; }
  std::uint64_t first_from(std::int64_t now_ns) const;
  std::uint64_t begin() const { return end_ - std::min<std::uint64_t>(end_, ticks_.size()); }

  mutable std::mutex mutex_;  ///< protects the members below
  std::vector<TickRecord> ticks_;
  std::vector<ContactRange>
      contact_ranges_;  ///< numbers of contacts, which count from 0 like those of records
  std::vector<Touch> contacts_;
  std::uint64_t end_ = 0;
  std::uint64_t contact_end_ = 0;
};

}  // namespace wrenchd
