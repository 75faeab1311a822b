// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>
#include <deque>
#include <optional>
#include <string>

#include "daemon/json_rpc.hpp"
#include "daemon/listening_socket.hpp"

namespace wrenchd {

/// A connection to the control socket of a daemon, for a command line: it waits for what it asks. One thread.
class ControlClient {
 public:
  /// Connects; path empty: $WRENCHD_SOCKET, then the usual places. Throws std::runtime_error, which says
  /// where it looked and what to do.
  explicit ControlClient(const std::string& path);

  /// Asks, and waits for the answer. Throws RpcError where it is an error, std::runtime_error where none
  /// comes.
  Json call(const std::string& method, const Json& params = Json::object());
  /// Says, and waits for nothing.
  void say(const std::string& method);
  /// The parameters of the next event; nothing: none came so soon, or a signal did. Throws std::runtime_error
  /// where the daemon has hung up.
  std::optional<Json> event(std::chrono::milliseconds limit);

  const std::string& path() const noexcept { return path_; }

 private:
  bool connect_to(const std::string& path);
  void send(const std::string& line);
  std::optional<std::string> line(std::chrono::milliseconds limit);

  std::string path_;
  OwnedFd socket_;
  std::string in_;
  std::deque<Json> events_;
  int last_id_ = 0;
};

}  // namespace wrenchd
