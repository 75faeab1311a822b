// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/pace_watch.hpp"

#include <algorithm>

namespace wrenchd {

FaultSet PaceWatch::check(TimePoint now, Duration slept) noexcept {
  const Duration since_last = last_tick_ ? now - *last_tick_ : period_;
  const bool woke = last_tick_ && slept - suspended_ > kSuspended;
  last_tick_ = now;
  suspended_ = slept;
  dt_s_ = std::clamp(seconds(since_last), 0.0, 2.0 * seconds(period_));
  lateness_ = std::max(since_last - period_, Duration{0});
  FaultSet found = 0;
  if (since_last < Duration{0}) found |= bit(Fault::clock_reversed);
  if (lateness_ > stopped_after_)
    found |= bit(Fault::loop_stalled);
  else if (lateness_ > kLateTick)
    found |= bit(Fault::tick_late);
  if (lateness_ > kLateTick) last_late_tick_ = now;
  if (woke) found |= bit(Fault::suspended);
  return found;
}

}  // namespace wrenchd
