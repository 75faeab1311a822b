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

/// The other end of a client library: a control socket that speaks the protocol as far as clients need it,
/// and behind it the real loop with the simulated device, in wall time, and its real shared memory. It knows
/// no roles; what clients are refused is the lease.
class StubDaemon {
 public:
  StubDaemon();
  ~StubDaemon();

  std::string socket() const { return (files_.path() / "control.sock").string(); }
  ServoLoop& loop() { return simulated_.station.loop(); }

  int beats() const { return beats_.load(); }
  bool leased() const { return holder_.load() >= 0; }
  /// Methods asked for since the start, in order.
  std::vector<std::string> asked() const;
  /// Sends an event to all that subscribed to its name.
  void tell(const std::string& name, const std::string& level);
  /// Sends these bytes, whatever they are, to all, in parts.
  void send_raw(const std::string& bytes);
  /// From here on nothing is answered.
  void fall_silent() { silent_.store(true); }
  /// As when a beat came too late.
  void end_lease();
  /// Ends all connections.
  void hang_up();

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
  void end(int peer);

  TemporaryDirectory files_;
  SimulatedStation<WallClock> simulated_;
  SharedState& state_;
  std::atomic<bool> stop_loop_{false};
  std::thread servo_;
  int listening_;
  mutable std::mutex mutex_;  ///< of what follows
  std::map<int, Peer> peers_;
  std::vector<std::string> asked_;
  std::uint64_t sequence_ = 0;
  std::atomic<int> beats_{0};
  std::atomic<int> holder_{-1};
  std::atomic<bool> silent_{false};
  std::jthread serving_;
};

}  // namespace wrenchd::test
