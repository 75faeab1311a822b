// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/client_watch.hpp"

#include "core/watch_limits.hpp"

namespace wrenchd {

FaultSet ClientWatch::check(TimePoint now) const noexcept {
  if (last_heartbeat_ && client_lost_) return bit(Fault::heartbeat_lost);
  if (!last_heartbeat_ || now - *last_heartbeat_ <= kHeartbeatTimeout) return 0;
  return bit(heartbeat_received_ ? Fault::heartbeat_lost : Fault::heartbeat_missing);
}

}  // namespace wrenchd
