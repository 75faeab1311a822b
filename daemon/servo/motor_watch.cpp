// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/motor_watch.hpp"

#include "core/watch_limits.hpp"

namespace wrenchd {

/// A report sent before the first enabling command still shows motors off. The check therefore waits for one
/// round trip.
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
  const bool off_too_long = now - off_since_ > kMotorsOff;
  if (sample.watchdog_tripped) return seen_on_ || off_too_long ? bit(Fault::watchdog_tripped) : 0;
  return off_too_long ? bit(Fault::motors_off) : 0;
}

}  // namespace wrenchd
