// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "core/clock.hpp"
#include "core/fault.hpp"
#include "core/watch_limits.hpp"

namespace wrenchd {

/// Detects late ticks, a stalled loop, a clock that runs backwards, and a machine that was suspended.
class PaceWatch {
 public:
  /// stalled_after: lateness from which a tick counts as a stall of the loop. RT-safe.
  PaceWatch(Duration period, Duration stalled_after) noexcept
      : period_(period), stalled_after_(stalled_after) {}

  /// Returns the faults of this tick. suspended: time that the machine has been suspended since boot. Call
  /// once per tick, first of all detectors. RT-safe.
  FaultSet check(TimePoint now, Duration suspended) noexcept;

  /// Returns the time since the last tick [s], clamped to 0 ... 2 periods. The clamp keeps integrators and
  /// ramps from jumping after a gap. RT-safe.
  double dt_s() const noexcept { return dt_s_; }
  /// Returns how late this tick is; 0 if it is not late. RT-safe.
  Duration lateness() const noexcept { return lateness_; }
  /// Returns true if a tick was late within the last kStaleSample. Old samples are then no fault of the
  /// device. RT-safe.
  bool recently_late(TimePoint now) const noexcept {
    return last_late_tick_ && now - *last_late_tick_ <= kStaleSample;
  }

 private:
  Duration period_;
  Duration stalled_after_;
  std::optional<TimePoint> last_tick_;
  std::optional<TimePoint> last_late_tick_;
  Duration suspended_{};  ///< Value of `suspended` in the previous tick.
  double dt_s_ = 0.0;
  Duration lateness_{};
};

}  // namespace wrenchd
