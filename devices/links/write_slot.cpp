// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/links/write_slot.hpp"

#include <algorithm>

namespace wrenchd {

LinkStatus WriteSlot::submit(TimePoint now, std::span<const std::uint8_t> report) noexcept {
  if (disconnected()) return LinkStatus::disconnected;
  if (report.size() > kMaxReportBytes) return LinkStatus::not_ready;

  const std::uint64_t ended = completed_.load(std::memory_order_acquire);
  if (ended == submitted_ || ended != completed_seen_) waiting_since_ = now;
  completed_seen_ = ended;
  const std::uint64_t failed_so_far = failed();
  const bool failed_now = failed_so_far != failed_seen_;
  failed_seen_ = failed_so_far;

  Numbered next;
  std::copy(report.begin(), report.end(), next.packet.bytes.begin());
  next.packet.length = report.size();
  next.packet.arrives = now;
  next.number = ++submitted_;
  slot_.write(next);
  return failed_now || overdue(now) ? LinkStatus::not_ready : LinkStatus::ok;
}

bool WriteSlot::overdue(TimePoint now) const noexcept {
  return completed_.load(std::memory_order_acquire) != submitted_ && now - waiting_since_ > deadline_;
}

bool WriteSlot::take(Packet& packet) noexcept {
  Numbered next;
  if (!slot_.read(next)) return false;
  packet = next.packet;
  replaced_.fetch_add(next.number - taken_ - 1, std::memory_order_relaxed);
  taken_ = next.number;
  return true;
}

void WriteSlot::complete(LinkStatus status) noexcept {
  if (status == LinkStatus::disconnected) disconnected_.store(true, std::memory_order_relaxed);
  (status == LinkStatus::ok ? written_ : failed_).fetch_add(1, std::memory_order_relaxed);
  completed_.store(taken_, std::memory_order_release);
}

}  // namespace wrenchd
