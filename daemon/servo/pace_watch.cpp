// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/pace_watch.hpp"

#include <algorithm>

namespace wrenchd {

FaultSet PaceWatch::look(TimePoint now, Duration slept) noexcept {
  const Duration since_last = last_ ? now - *last_ : period_;
  const bool woke = last_ && slept - slept_ > kSuspended;
  last_ = now;
  slept_ = slept;
  dt_s_ = std::clamp(seconds(since_last), 0.0, 2.0 * seconds(period_));
  late_ = std::max(since_last - period_, Duration{0});
  FaultSet found = 0;
  if (since_last < Duration{0}) found |= bit(Fault::clock_back);
  if (late_ > stopped_after_)
    found |= bit(Fault::loop_stopped);
  else if (late_ > kLateTick)
    found |= bit(Fault::tick_late);
  if (late_ > kLateTick) late_at_ = now;
  if (woke) found |= bit(Fault::suspended);
  return found;
}

}  // namespace wrenchd
