// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/loop_totals.hpp"

#include <cmath>

namespace wrenchd {
namespace {

double length(const double* v) noexcept {
  return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/// There is one writer, so that load and store need no exchange. Ignores NaN.
void raise_to(std::atomic<double>& most, double value) noexcept {
  if (value > most.load(std::memory_order_relaxed)) most.store(value, std::memory_order_relaxed);
}

}  // namespace

void LoopTotals::add(const TickRecord& record) noexcept {
  if (ticks.fetch_add(1, std::memory_order_relaxed) == 0)
    first_tick_ns.store(record.now_ns, std::memory_order_relaxed);
  last_tick_ns.store(record.now_ns, std::memory_order_relaxed);
  if (record.contacts > 0) ticks_in_contact.fetch_add(1, std::memory_order_relaxed);
  raise_to(max_force_sent_N, length(record.F_out.data()));
  raise_to(max_torque_sent_Nm, length(&record.F_out[3]));
  raise_to(max_force_on_tool_N, length(record.F_T.data()));
  raise_to(max_torque_on_tool_Nm, length(&record.F_T[3]));
}

double LoopTotals::rate_Hz() const noexcept {
  const std::int64_t span_ns =
      last_tick_ns.load(std::memory_order_relaxed) - first_tick_ns.load(std::memory_order_relaxed);
  const std::uint64_t count = ticks.load(std::memory_order_relaxed);
  return count < 2 || span_ns <= 0 ? 0.0
                                   : 1e9 * static_cast<double>(count - 1) / static_cast<double>(span_ns);
}

}  // namespace wrenchd
