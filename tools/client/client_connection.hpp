// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <mutex>
#include <string>

#include <nlohmann/json.hpp>

namespace wrenchd {

/// A socket that speaks JSON-RPC 2.0, one object a line. An answer is told from events that come in between
/// by its id. Any thread may call anything.
class ClientConnection {
 public:
  using Clock = std::chrono::steady_clock;

  /// Throws ClientError.
  ClientConnection(const std::string& socket, std::chrono::milliseconds answer_within);
  ~ClientConnection();
  ClientConnection(const ClientConnection&) = delete;
  ClientConnection& operator=(const ClientConnection&) = delete;

  /// descriptor: takes the one that comes with the answer; -1 where none does. Null: such are closed.
  nlohmann::json call(const std::string& method, const nlohmann::json& params, int* descriptor = nullptr);
  /// Wants no answer.
  void notify(const std::string& method);
  bool poll_event(nlohmann::json& out, std::chrono::milliseconds timeout);
  bool is_connected() const noexcept;
  const std::string& socket_path() const noexcept { return socket_path_; }

 private:
  bool read_line(std::string& line, Clock::time_point end);
  bool wait_for(short events, Clock::time_point end) const;
  void receive();
  void send(const nlohmann::json& request);
  void close_descriptor() noexcept;
  void queue_event(nlohmann::json message);

  std::string socket_path_;  ///< path of the socket; before socket_, which finds it
  int socket_;
  std::chrono::milliseconds response_timeout_;
  std::mutex read_mutex_;
  std::mutex write_mutex_;
  std::string received_;
  std::size_t scanned_ = 0;  ///< of received_, without an end of line
  int descriptor_ = -1;      ///< that came with what was received
  std::int64_t last_id_ = 0;
  std::deque<nlohmann::json> events_;
};

}  // namespace wrenchd
