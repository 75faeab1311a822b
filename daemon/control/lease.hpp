// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/clock.hpp"
#include "daemon/control/event_feed.hpp"

namespace wrenchd {

class ServoLoop;

/// The right to arm: one client has it at a time, for as long as it shows that it lives. What it says of its
/// life goes on to the loop, which watches by itself: where this process hangs, the hand is released too.
/// One thread, not that of the servo.
class Lease {
 public:
  Lease(ServoLoop& loop, EventFeed& feed) : loop_(loop), feed_(feed) {}

  struct Holder {
    std::uint64_t client = 0;
    std::string identity;
  };
  const std::optional<Holder>& holder() const noexcept { return holder_; }
  bool held_by(std::uint64_t client) const noexcept { return holder_ && holder_->client == client; }

  /// Nobody may have it, or the same client. Counts as a sign of life.
  void acquire(const Holder& client, TimePoint now);
  /// Takes it from whoever has it; who armed with it is disarmed.
  void preempt(const Holder& client, TimePoint now);
  /// Disarms what was armed with it.
  void release(const std::string& why);
  /// Its holder lives.
  void heartbeat(TimePoint now);
  /// Its holder arms. Counts as a sign of life.
  void arm(TimePoint now);
  /// That client's connection has ended: if it held the lease the hand is released.
  void client_lost(std::uint64_t client);
  /// Ends the lease of a holder that does not say any more that it lives, in the same way.
  void check(TimePoint now);
  /// When to look again; the end of time where nobody holds it.
  TimePoint next_check_at() const noexcept;

  /// What is armed now, if anything is, was armed with this lease.
  bool armed() const noexcept { return armed_; }

 private:
  void end(EventLevel level, const std::string& what);

  ServoLoop& loop_;
  EventFeed& feed_;
  std::optional<Holder> holder_;
  TimePoint last_heartbeat_{};
  bool armed_ = false;
};

}  // namespace wrenchd
