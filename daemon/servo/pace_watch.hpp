// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "config/settings.hpp"
#include "core/clock.hpp"
#include "core/fault.hpp"
#include "core/watch_limits.hpp"

namespace wrenchd {

/// Detects late ticks, a stalled loop, a clock that runs backwards, and a machine that was suspended. All
/// members are RT-safe.
class PaceWatch {
 public:
  /// stalled_after: lateness from which a tick counts as a stall of the loop.
  PaceWatch(Duration period, Duration stalled_after) noexcept
      : period_(period), stalled_after_(stalled_after) {}

  /// Returns the faults of a tick that starts at `now`. suspended: time that the machine has been suspended
  /// since boot. Call once per tick.
  FaultSet check(TimePoint now, Duration suspended) noexcept;

  /// Returns the time since the last tick [s], clamped to 0 ... 2 periods. The clamp keeps integrators and
  /// ramps from jumping after a gap.
  double dt_s() const noexcept { return dt_s_; }
  /// Returns how late this tick is; 0 if it is on time.
  Duration lateness() const noexcept { return lateness_; }
  /// Returns true if a tick was late within the last kStaleSample. Old samples are then no fault of the
  /// device.
  bool recently_late(TimePoint now) const noexcept {
    return last_late_tick_ && now - *last_late_tick_ <= kStaleSample;
  }

 private:
  Duration period_;
  Duration stalled_after_;
  std::optional<TimePoint> last_tick_;       ///< Start of the previous tick.
  std::optional<TimePoint> last_late_tick_;  ///< Start of the last tick that was late.
  Duration suspended_{};                     ///< Value of `suspended` in the previous tick.
  double dt_s_ = 0.0;
  Duration lateness_{};
};

/// Returns the detector for these settings. Without required real-time priority a stall counts as a late tick
/// only. RT-safe.
PaceWatch make_pace_watch(const ServoSettings& settings) noexcept;

}  // namespace wrenchd
