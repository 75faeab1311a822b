// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <cstdint>

#include "daemon/servo/tick_record.hpp"

namespace wrenchd {

/// Totals over all ticks of a loop. The servo thread adds each tick, any thread reads. All members are
/// RT-safe.
struct LoopTotals {
  std::atomic<std::uint64_t> ticks{0};
  std::atomic<std::uint64_t> ticks_in_contact{0};  ///< Ticks with at least one contact.
  std::atomic<std::int64_t> first_tick_ns{0};      ///< Start of the first tick on the monotonic clock.
  std::atomic<std::int64_t> last_tick_ns{0};       ///< Start of the newest tick on the monotonic clock.
  std::atomic<double> max_force_sent_N{0.0};       ///< Largest force that was sent to the device.
  std::atomic<double> max_torque_sent_Nm{0.0};     ///< Largest torque that was sent to the device.
  std::atomic<double> max_force_on_tool_N{0.0};    ///< Largest contact force on the tool, before all limits.
  std::atomic<double> max_torque_on_tool_Nm{0.0};  ///< Largest contact torque about the origin of T.

  /// Adds one tick. Servo thread only.
  void add(const TickRecord& record) noexcept;
  /// Returns the mean rate from the first to the newest tick [Hz]; 0 before the second tick.
  double rate_Hz() const noexcept;
};

}  // namespace wrenchd
