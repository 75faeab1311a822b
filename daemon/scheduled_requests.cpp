// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/scheduled_requests.hpp"

#include <algorithm>
#include <utility>

#include "daemon/servo/servo_loop.hpp"

namespace wrenchd {

ScheduledRequests::ScheduledRequests(bool arm, std::vector<TimedCommand> commands, TimePoint start)
    : arm_(arm), commands_(std::move(commands)), start_(start) {}

void ScheduledRequests::send_due(ServoLoop& loop, TimePoint now) {
  for (; next_ < commands_.size() && start_ + commands_[next_].at <= now; ++next_)
    loop.requests().request(commands_[next_].commands);
  if (!arm_ || loop.telemetry().state() != State::disarmed) return;
  loop.requests().arm();
  arm_ = false;
}

TimePoint ScheduledRequests::next_time(TimePoint limit) const {
  return next_ < commands_.size() ? std::min(limit, start_ + commands_[next_].at) : limit;
}

}  // namespace wrenchd
