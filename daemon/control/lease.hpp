// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/clock.hpp"
#include "daemon/control/event_feed.hpp"

namespace wrenchd {

class ServoLoop;

/// The right to arm. One client holds it at a time, as long as its heartbeats arrive. The lease forwards each
/// heartbeat to the servo loop, which monitors them too: the loop releases the hand if this thread hangs. Not
/// RT-safe: allocates. One thread, not the servo thread.
class Lease {
 public:
  Lease(ServoLoop& loop, EventFeed& feed) : loop_(loop), feed_(feed) {}

  struct Holder {
    std::uint64_t client = 0;
    std::string identity;
  };
  const std::optional<Holder>& holder() const noexcept { return holder_; }
  bool held_by(std::uint64_t client) const noexcept { return holder_ && holder_->client == client; }

  /// Gives the lease to the client. Counts as a heartbeat. Precondition: the lease is free, or this client
  /// holds it.
  void acquire(const Holder& client, TimePoint now);
  /// Gives the lease to the client, even if another client holds it. Disarms the loop if the previous holder
  /// armed it.
  void preempt(const Holder& client, TimePoint now);
  /// Frees the lease, and disarms the loop if the holder armed it. reason: ends the log line "lease:
  /// <holder>".
  void release(const std::string& reason);
  /// The holder has sent a heartbeat.
  void heartbeat(TimePoint now);
  /// The holder arms the loop. Counts as a heartbeat.
  void arm(TimePoint now);
  /// Disarms the loop, no matter who armed it. The lease keeps its holder, which may leave from now on
  /// without a fault: the force fades anyway.
  void disarm();
  /// The connection of this client has ended. If the client holds the lease, the lease ends, and the loop
  /// releases the hand if the client armed it.
  void client_lost(std::uint64_t client);
  /// Ends the lease like client_lost() if the last heartbeat of its holder is older than kHeartbeatTimeout.
  void check(TimePoint now);
  /// Returns when check() must run next; TimePoint::max() if the lease is free.
  TimePoint next_check_at() const noexcept;

  /// True if the holder has armed the loop.
  bool armed() const noexcept { return armed_; }

 private:
  void end(EventLevel level, const std::string& text);

  ServoLoop& loop_;
  EventFeed& feed_;
  std::optional<Holder> holder_;
  TimePoint last_heartbeat_{};
  bool armed_ = false;
  bool fading_ = false;  ///< the loop was disarmed on request since the holder armed it
};

}  // namespace wrenchd
