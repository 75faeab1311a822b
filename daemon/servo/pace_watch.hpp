// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "core/clock.hpp"
#include "core/fault.hpp"
#include "core/watch_limits.hpp"

namespace wrenchd {

/// Looks at the times of the ticks: late, stopped, back, and a machine that slept in between. RT safe.
class PaceWatch {
 public:
  /// stopped_after: how late a tick has to be to be a loop that stood still, and not a late one any more.
  PaceWatch(Duration period, Duration stopped_after) noexcept
      : period_(period), stopped_after_(stopped_after) {}

  /// slept: how long the machine has slept since it was switched on.
  FaultSet check(TimePoint now, Duration slept) noexcept;

  /// Since the last tick [s]: never less than nothing, and after a gap no more than two periods, so that
  /// nothing that grows with time leaps.
  double dt_s() const noexcept { return dt_s_; }
  /// How late this tick is; nothing where it is not.
  Duration lateness() const noexcept { return lateness_; }
  /// Did a tick come late so short a time ago that old reports are nobody's fault but ours?
  bool recently_late(TimePoint now) const noexcept {
    return last_late_tick_ && now - *last_late_tick_ <= kStaleSample;
  }

 private:
  Duration period_;
  Duration stopped_after_;
  std::optional<TimePoint> last_tick_;
  std::optional<TimePoint> last_late_tick_;  ///< the last late one
  Duration suspended_{};
  double dt_s_ = 0.0;
  Duration lateness_{};
};

}  // namespace wrenchd
