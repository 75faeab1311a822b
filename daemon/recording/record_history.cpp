// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recording/record_history.hpp"

#include <algorithm>
#include <array>
#include <new>
#include <stdexcept>
#include <string>

namespace wrenchd {

/// With locked memory a limit may reject an allocation although the machine has enough memory.
RecordHistory::RecordHistory(std::size_t ticks) try
    : ticks_(std::max<std::size_t>(ticks, 1)),
      contact_ranges_(ticks_.size()),
      contacts_(std::max(kContactsPerTick * ticks_.size(), kMaxTouches)) {
} catch (const std::bad_alloc&) {
  throw std::runtime_error(
      "the last " + std::to_string(ticks) + " ticks need " +
      std::to_string(ticks * kBytesPerTick / 1'000'000) +
      " MB of memory, which are not available; lower flight_s in [recording], or raise the "
      "limit of locked memory (ulimit -l, LimitMEMLOCK=)");
}

void RecordHistory::append(const StateRecord& record) {
  const std::scoped_lock lock(mutex_);
  const std::size_t place = end_ % ticks_.size();
  ticks_[place] = record.tick;
  contact_ranges_[place] = {contact_end_, static_cast<std::uint32_t>(record.contact_count)};
  for (std::uint64_t i = 0; i < record.contact_count; ++i)
    contacts_[(contact_end_ + i) % contacts_.size()] = record.contacts[i];
  contact_end_ += record.contact_count;
  ++end_;
}

RecordHistory::RecordRange RecordHistory::stored_range() const {
  const std::scoped_lock lock(mutex_);
  return {begin(), end_};
}

std::int64_t RecordHistory::newest_ns() const {
  const std::scoped_lock lock(mutex_);
  return end_ == 0 ? 0 : tick(end_ - 1).now_ns;
}

std::int64_t RecordHistory::tick_at(std::int64_t now_ns) const {
  const std::scoped_lock lock(mutex_);
  const std::uint64_t next = first_from(now_ns + 1);
  return next == begin() ? -1 : static_cast<std::int64_t>(tick(next - 1).tick);
}

std::uint64_t RecordHistory::first_at_or_after(std::int64_t now_ns) const {
  const std::scoped_lock lock(mutex_);
  return first_from(now_ns);
}

/// Precondition: mutex_ is locked.
std::uint64_t RecordHistory::first_from(std::int64_t now_ns) const {
  std::uint64_t low = begin(), high = end_;  // binary search: the times of ticks increase
  while (low < high) {
    const std::uint64_t middle = low + (high - low) / 2;
    if (tick(middle).now_ns < now_ns)
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

std::uint64_t RecordHistory::copy(std::uint64_t from, std::uint64_t end, std::size_t most,
                                  RecordBatch& out) const {
  out.clear();
  const std::scoped_lock lock(mutex_);
  const std::uint64_t first = std::max(from, begin());
  const std::uint64_t last = std::min({first + most, end, end_});
  const std::uint64_t touches_begin = contact_end_ - std::min<std::uint64_t>(contact_end_, contacts_.size());
  for (std::uint64_t number = first; number < last; ++number) {
    const ContactRange& range = contact_ranges_[number % contact_ranges_.size()];
    const bool there = range.first >= touches_begin;
    std::array<Touch, kMaxTouches> its;
    for (std::uint32_t i = 0; there && i < range.count; ++i)
      its[i] = contacts_[(range.first + i) % contacts_.size()];
    out.add(tick(number), std::span(its).first(there ? range.count : 0));
  }
  return first;
}

}  // namespace wrenchd
