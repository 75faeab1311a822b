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

/// The last ticks with their contacts, in memory that is taken once and never grows: what the flight recorder
/// holds, and what a slow disk may lag behind. Records are numbered from 0 in the order in which they came.
/// Any thread but the servo's.
class RecordHistory {
 public:
  /// Contacts that there is room for, as a mean over all ticks. Where there are more, those of the oldest
  /// ticks are gone first; the ticks stay.
  static constexpr std::size_t kContactsPerTick = 8;
  /// Of memory, for a tick.
  static constexpr std::size_t kBytesPerTick =
      sizeof(TickRecord) + sizeof(ContactRange) + kContactsPerTick * sizeof(Touch);

  /// Room for so many ticks, at least one.
  explicit RecordHistory(std::size_t ticks);

  void append(const StateRecord& record);

  /// Numbers of the oldest record held, and of the one that comes next.
  struct RecordRange {
    std::uint64_t begin = 0;
    std::uint64_t end = 0;
  };
  RecordRange stored_range() const;
  /// Number of the first record held that began at that time [ns] or later; held().end: there is none.
  std::uint64_t first_at_or_after(std::int64_t now_ns) const;
  /// When the newest began [ns]; 0: there is none.
  std::int64_t newest_ns() const;

  /// Puts records from that number on into `out`, in place of what is in it: `most` of them, or as many as
  /// there are before `end`. Where the first are not held any more it begins later. Returns the number of the
  /// first.
  std::uint64_t copy(std::uint64_t from, std::uint64_t end, std::size_t most, RecordBatch& out) const;

 private:
  const TickRecord& tick(std::uint64_t number) const { return ticks_[number % ticks_.size()]; }
  std::uint64_t begin() const { return end_ - std::min<std::uint64_t>(end_, ticks_.size()); }

  mutable std::mutex mutex_;  ///< of all of the below
  std::vector<TickRecord> ticks_;
  std::vector<ContactRange> contact_ranges_;  ///< by numbers of touches, which are counted as ticks are
  std::vector<Touch> contacts_;
  std::uint64_t end_ = 0;
  std::uint64_t contact_end_ = 0;
};

}  // namespace wrenchd
