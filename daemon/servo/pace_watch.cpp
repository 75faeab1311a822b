// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/pace_watch.hpp"

#include <algorithm>

namespace wrenchd {

FaultSet PaceWatch::check(TimePoint now, Duration suspended) noexcept {
  const Duration since_last = last_tick_ ? now - *last_tick_ : period_;
  const bool woke_up = last_tick_ && suspended - suspended_ > kSuspended;
  last_tick_ = now;
  suspended_ = suspended;
  dt_s_ = std::clamp(seconds(since_last), 0.0, 2.0 * seconds(period_));
  lateness_ = std::max(since_last - period_, Duration{0});
  FaultSet faults = 0;
  if (since_last < Duration{0}) faults |= bit(Fault::clock_reversed);
  if (lateness_ > stalled_after_)
    faults |= bit(Fault::loop_stalled);
  else if (lateness_ > kLateTick)
    faults |= bit(Fault::tick_late);
  if (lateness_ > kLateTick) last_late_tick_ = now;
  if (woke_up) faults |= bit(Fault::suspended);
  return faults;
}

PaceWatch make_pace_watch(const ServoSettings& settings) noexcept {
  const Duration stalled_after =
      settings.realtime == Realtime::required ? from_seconds(settings.late_limit_s) : Duration::max();
  return {from_seconds(1.0 / settings.rate_Hz), stalled_after};
}

}  // namespace wrenchd
