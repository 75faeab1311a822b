// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "core/clock.hpp"
#include "core/fault.hpp"

namespace wrenchd {

/// Detects the loss of the client that armed the loop with a lease. From the arming on, the client must send
/// a heartbeat at least every 100 ms.
class ClientWatch {
 public:
  /// Starts the timeout when a client arms with a lease. RT-safe.
  void start(TimePoint now) noexcept {
    last_heartbeat_ = now;
    heartbeat_received_ = client_lost_ = false;
  }
  /// Restarts the timeout. RT-safe.
  void heartbeat(TimePoint now) noexcept {
    if (last_heartbeat_) last_heartbeat_ = now;
    heartbeat_received_ = true;
  }
  /// Reports that the client's connection closed, so that check() need not wait for the timeout. RT-safe.
  void client_lost() noexcept { client_lost_ = last_heartbeat_.has_value(); }
  /// Stops the timeout, because the loop is no longer armed. RT-safe.
  void stop() noexcept { last_heartbeat_.reset(); }

  /// Returns heartbeat_lost if the client stopped, heartbeat_missing if it never sent a heartbeat. RT-safe.
  FaultSet check(TimePoint now) const noexcept;

 private:
  std::optional<TimePoint> last_heartbeat_;  ///< Time of the last heartbeat or of start(); empty if stopped.
  bool heartbeat_received_ = false;          ///< True after the first heartbeat.
  bool client_lost_ = false;                 ///< True after client_lost().
};

}  // namespace wrenchd
