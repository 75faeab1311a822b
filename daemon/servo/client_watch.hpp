// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "core/clock.hpp"
#include "core/fault.hpp"

namespace wrenchd {

/// Looks whether whoever armed is still there. It has to say so every 100 ms, beginning with the arming: a
/// watch that waits for a first sign of life would never begin where there is none. RT safe.
class ClientWatch {
 public:
  /// Somebody armed who promised to say that it lives.
  void start(TimePoint now) noexcept {
    last_heartbeat_ = now;
    heartbeat_received_ = client_lost_ = false;
  }
  void heartbeat(TimePoint now) noexcept {
    if (last_heartbeat_) last_heartbeat_ = now;
    heartbeat_received_ = true;
  }
  /// Its connection has ended: what the watch would find after 100 ms it finds now.
  void client_lost() noexcept { client_lost_ = last_heartbeat_.has_value(); }
  /// Nobody is armed any more.
  void stop() noexcept { last_heartbeat_.reset(); }

  FaultSet check(TimePoint now) const noexcept;

 private:
  std::optional<TimePoint> last_heartbeat_;
  bool heartbeat_received_ = false;
  bool client_lost_ = false;
};

}  // namespace wrenchd
