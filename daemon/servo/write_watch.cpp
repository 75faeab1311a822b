// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/write_watch.hpp"

#include "core/watch_limits.hpp"

namespace wrenchd {

FaultSet WriteWatch::check(Fault written, TimePoint now) noexcept {
  if (written == Fault::device_lost) return bit(Fault::device_lost);
  if (written != Fault::write_failed) {
    blocked_since_.reset();
    return 0;
  }
  if (!blocked_since_) blocked_since_ = now;
  const Duration blocked = now - *blocked_since_;
  if (blocked >= kFailedWrite) return bit(Fault::write_failed);
  return blocked >= kBlockedWrite ? bit(Fault::write_blocked) : 0;
}

}  // namespace wrenchd
