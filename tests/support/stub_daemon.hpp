// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "daemon/wall_clock.hpp"
#include "tests/support/shipped_config.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test {

/// A stub of the daemon for tests of the client libraries. Its control socket offers the methods that clients
/// need. Behind the socket runs the real loop, with the simulated device, in wall time, and with the real
/// shared memory. The stub has no roles; it rejects requests only because of the lease.
class StubDaemon {
 public:
  StubDaemon();
  ~StubDaemon();

  std::string socket() const { return (files_.path() / "control.sock").string(); }
  ServoLoop& loop() { return simulated_.runtime.loop(); }

  int heartbeats() const { return heartbeats_.load(); }
  bool leased() const { return holder_.load() >= 0; }
  /// Returns the methods that clients requested since the start, in order.
  std::vector<std::string> requested_methods() const;
  /// Sends an event to all clients that subscribed to its name.
  void send_event(const std::string& name, const std::string& level);
  /// Sends these bytes in parts to all clients.
  void send_raw(const std::string& bytes);
  /// From now on the stub answers no request.
  void stop_answering() { silent_.store(true); }
  /// Ends the lease as if a heartbeat was missing.
  void expire_lease();
  /// Closes all connections.
  void disconnect_all();

 private:
  struct Peer {
    std::string received;
    bool subscribed = false;
    std::vector<std::string> names;
  };

  void serve(const std::stop_token& stop);
  bool receive(int peer);
  void answer(int peer, const std::string& line);
  nlohmann::json result_of(int peer, const std::string& method, const nlohmann::json& params,
                           int& descriptor);
  nlohmann::json status();
  void disconnect(int peer);

  TemporaryDirectory files_;
  SimulatedRuntime<WallClock> simulated_;
  SharedState& state_;
  std::atomic<bool> stop_loop_{false};
  std::thread servo_;
  int listening_;
  mutable std::mutex mutex_;  ///< guards all members below
  std::map<int, Peer> peers_;
  std::vector<std::string> requested_methods_;
  std::uint64_t sequence_ = 0;
  std::atomic<int> heartbeats_{0};
  std::atomic<int> holder_{-1};
  std::atomic<bool> silent_{false};
  std::jthread serving_;
};

}  // namespace wrenchd::test
