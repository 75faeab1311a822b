// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <mutex>
#include <string>

#include <nlohmann/json.hpp>

namespace wrenchd {

/// A socket that speaks JSON-RPC 2.0 with one object per line. Matches responses by their id and queues the
/// events that arrive between them. Thread-safe. Not RT-safe: waits for the daemon.
class ClientConnection {
 public:
  using Clock = std::chrono::steady_clock;

  /// Throws ClientError if no daemon accepts the connection.
  ClientConnection(const std::string& socket, std::chrono::milliseconds answer_within);
  ~ClientConnection();
  ClientConnection(const ClientConnection&) = delete;
  ClientConnection& operator=(const ClientConnection&) = delete;

  /// Sends a request and returns its result. descriptor: receives the file descriptor of the response, or -1
  /// if there is none. Null: closes such descriptors. Throws ClientError.
  nlohmann::json call(const std::string& method, const nlohmann::json& params, int* descriptor = nullptr);
  /// Sends a notification, which has no response. Throws ClientError.
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

  std::string socket_path_;  ///< path of the socket; declared before socket_, whose initialization sets it
  int socket_;
  std::chrono::milliseconds response_timeout_;
  std::mutex read_mutex_;
  std::mutex write_mutex_;
  std::string received_;
  std::size_t scanned_ = 0;  ///< number of bytes in received_ that contain no line end
  int descriptor_ = -1;      ///< descriptor received with the pending data; -1: none
  std::int64_t last_id_ = 0;
  std::deque<nlohmann::json> events_;
};

}  // namespace wrenchd
