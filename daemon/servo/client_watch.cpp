// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/client_watch.hpp"

#include "core/watch_limits.hpp"

namespace wrenchd {

FaultSet ClientWatch::look(TimePoint now) const noexcept {
  if (last_ && gone_) return bit(Fault::client_gone);
  if (!last_ || now - *last_ <= kSilentClient) return 0;
  return bit(beaten_ ? Fault::client_gone : Fault::client_silent);
}

}  // namespace wrenchd
