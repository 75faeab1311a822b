// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/motor_watch.hpp"

#include "core/watch_limits.hpp"

namespace wrenchd {

/// A flag from before the motors were driven says nothing, so the way of the first command there and of its
/// answer back is waited for.
FaultSet MotorWatch::check(const DeviceSample& sample, bool driven, TimePoint now) noexcept {
  if (!driven || !driven_) {
    driven_ = driven;
    seen_on_ = false;
    off_since_ = now;
    return 0;
  }
  if (!sample.fresh) return 0;
  if (sample.motors_on) {
    seen_on_ = true;
    off_since_ = now;
    return 0;
  }
  const bool long_off = now - off_since_ > kMotorsOff;
  if (sample.watchdog_tripped) return seen_on_ || long_off ? bit(Fault::watchdog_tripped) : 0;
  return long_off ? bit(Fault::motors_off) : 0;
}

}  // namespace wrenchd
