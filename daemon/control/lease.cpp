// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/lease.hpp"

#include "core/watch_limits.hpp"
#include "daemon/servo/servo_loop.hpp"

namespace wrenchd {
namespace {

Json holder_json(const std::optional<Lease::Holder>& holder) {
  return {{"holder", holder ? Json(holder->identity) : Json(nullptr)}};
}

}  // namespace

void Lease::acquire(const Holder& client, TimePoint now) {
  const bool already_held = held_by(client.client);
  holder_ = client;
  heartbeat(now);
  if (already_held) return;
  armed_ = false;
  feed_.emit("lease", EventLevel::info, "lease: " + client.identity + " holds it", holder_json(holder_));
}

void Lease::preempt(const Holder& client, TimePoint now) {
  if (holder_ && !held_by(client.client)) {
    if (armed_) loop_.requests().disarm();
    end(EventLevel::warning, "lease: " + client.identity + " preempts " + holder_->identity);
  }
  acquire(client, now);
}

void Lease::release(const std::string& why) {
  if (!holder_) return;
  if (armed_) loop_.requests().disarm();
  end(EventLevel::info, "lease: " + holder_->identity + " " + why);
}

void Lease::heartbeat(TimePoint now) {
  last_heartbeat_ = now;
  loop_.requests().heartbeat();
}

void Lease::arm(TimePoint now) {
  last_heartbeat_ = now;
  armed_ = true;
  fading_ = false;
  loop_.requests().arm_with_lease();
}

void Lease::disarm() {
  fading_ = true;
  loop_.requests().disarm();
}

void Lease::client_lost(std::uint64_t client) {
  if (!held_by(client)) return;
  const bool needs_force_off = armed_ && !fading_;
  if (needs_force_off) loop_.requests().client_lost();
  end(needs_force_off ? EventLevel::warning : EventLevel::info,
      "lease: " + holder_->identity + " disconnected");
}

void Lease::check(TimePoint now) {
  if (!holder_ || now - last_heartbeat_ <= kHeartbeatTimeout) return;
  if (armed_ && !fading_) loop_.requests().client_lost();
  end(EventLevel::warning, "lease: " + holder_->identity + " sends no heartbeat any more");
}

TimePoint Lease::next_check_at() const noexcept {
  return holder_ ? last_heartbeat_ + kHeartbeatTimeout + std::chrono::milliseconds(1) : TimePoint::max();
}

void Lease::end(EventLevel level, const std::string& text) {
  holder_.reset();
  armed_ = fading_ = false;
  feed_.emit("lease", level, text, holder_json(holder_));
}

}  // namespace wrenchd
