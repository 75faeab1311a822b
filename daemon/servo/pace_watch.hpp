// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "config/settings.hpp"
#include "core/clock.hpp"
#include "core/fault.hpp"
#include "core/watch_limits.hpp"

namespace wrenchd {

/// Detects ticks that come late, a loop that stalls, a clock that runs backwards, and a machine that was
/// suspended. All members are RT-safe.
class PaceWatch {
 public:
  /// stalled_after: a tick that is later than this is a stalled loop, not a late tick.
  PaceWatch(Duration period, Duration stalled_after) noexcept
      : period_(period), stalled_after_(stalled_after) {}

  /// Faults of a tick that starts at `now`. suspended: how long the machine has been suspended since it was
  /// switched on.
  FaultSet check(TimePoint now, Duration suspended) noexcept;

  /// Time since the previous tick: at least 0, and at most two periods, so that nothing that integrates over
  /// time jumps after a gap.
  double dt_s() const noexcept { return dt_s_; }
  /// How late this tick is; 0 if it is on time.
  Duration lateness() const noexcept { return lateness_; }
  /// True if a tick was late so recently that old reports are the fault of the loop and not of the device.
  bool recently_late(TimePoint now) const noexcept {
    return last_late_tick_ && now - *last_late_tick_ <= kStaleSample;
  }

 private:
  Duration period_;
  Duration stalled_after_;
  std::optional<TimePoint> last_tick_;       ///< Start of the previous tick.
  std::optional<TimePoint> last_late_tick_;  ///< Start of the last tick that was late.
  Duration suspended_{};                     ///< Time suspended, as of the previous tick.
  double dt_s_ = 0.0;
  Duration lateness_{};
};

/// Watch for the pace of these settings. Without real-time priority a loop may stall for a moment: its ticks
/// are late then, and nothing more. RT-safe.
PaceWatch make_pace_watch(const ServoSettings& settings) noexcept;

}  // namespace wrenchd
