// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/lease.hpp"

#include "core/watch_limits.hpp"
#include "daemon/servo/servo_loop.hpp"

namespace wrenchd {
namespace {

Json holder_json(const std::optional<Lease::Holder>& holder) {
  return {{"holder", holder ? Json(holder->who) : Json(nullptr)}};
}

}  // namespace

void Lease::take(const Holder& client, TimePoint now) {
  const bool again = held_by(client.client);
  holder_ = client;
  beat(now);
  if (again) return;
  armed_ = false;
  feed_.tell("lease", EventLevel::info, "lease: " + client.who + " has it", holder_json(holder_));
}

void Lease::take_over(const Holder& client, TimePoint now) {
  if (holder_ && !held_by(client.client)) {
    if (armed_) loop_.disarm();
    end(EventLevel::warning, "lease: " + client.who + " takes it from " + holder_->who);
  }
  take(client, now);
}

void Lease::give(const std::string& why) {
  if (!holder_) return;
  if (armed_) loop_.disarm();
  end(EventLevel::info, "lease: " + holder_->who + " " + why);
}

void Lease::beat(TimePoint now) {
  last_ = now;
  loop_.live();
}

void Lease::arm(TimePoint now) {
  last_ = now;
  armed_ = true;
  loop_.arm_with_lease();
}

void Lease::hung_up(std::uint64_t client) {
  if (!held_by(client)) return;
  if (armed_) loop_.hang_up();
  end(armed_ ? EventLevel::warning : EventLevel::info, "lease: " + holder_->who + " hung up");
}

void Lease::look(TimePoint now) {
  if (!holder_ || now - last_ <= kSilentClient) return;
  if (armed_) loop_.hang_up();
  end(EventLevel::warning, "lease: " + holder_->who + " gives no sign of life any more");
}

TimePoint Lease::look_again_at() const noexcept {
  return holder_ ? last_ + kSilentClient + std::chrono::milliseconds(1) : TimePoint::max();
}

void Lease::end(EventLevel level, const std::string& what) {
  holder_.reset();
  armed_ = false;
  feed_.tell("lease", level, what, holder_json(holder_));
}

}  // namespace wrenchd
