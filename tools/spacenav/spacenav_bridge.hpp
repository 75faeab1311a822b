// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include <wrenchd/client.hpp>

#include "tools/spacenav/axis_rates.hpp"
#include "tools/spacenav/spacenav_server.hpp"

namespace wrenchd {

/// What moves the programs.
enum class SteeringPose : std::uint8_t {
  hand,  ///< the pose that the hand commands
  tool,  ///< the tool, which obstacles stop
};

struct SpacenavOptions {
  std::string daemon_socket;  ///< empty: the default socket of wrenchd
  SteeringPose pose = SteeringPose::hand;
  FullDeflection full;
  std::chrono::milliseconds period{16};
};

/// Sends motion and buttons of wrenchd's state to the programs of a spacenav server. A daemon that ends or is
/// not there yet is looked for again once a second. Not RT-safe.
class SpacenavBridge {
 public:
  SpacenavBridge(SpacenavServer& server, SpacenavOptions options);
  /// Serves until `end_fd` can be read.
  void run(int end_fd);

 private:
  struct Source {
    Client client;
    StateReader state;
  };

  void connect();
  void disconnect(const std::string& why);
  void send_news();
  void send_buttons(std::uint32_t pressed);
  void stop_motion();

  SpacenavServer& server_;
  SpacenavOptions options_;
  std::optional<Source> source_;
  std::chrono::steady_clock::time_point next_try_{};
  std::string told_;  ///< last problem that was printed
  SpacenavDevice device_;
  TickState tick_;
  std::optional<PoseNumbers> last_X_W_;
  std::int64_t last_ns_ = 0;
  std::chrono::steady_clock::time_point last_tick_{};
  std::uint32_t buttons_ = 0;
};

}  // namespace wrenchd
