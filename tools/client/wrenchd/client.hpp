// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <wrenchd/client_error.hpp>
#include <wrenchd/state_reader.hpp>

namespace wrenchd {

/// What the daemon told its subscribers.
struct ClientEvent {
  std::uint64_t sequence = 0;  ///< one more for each event; a gap is what was dropped
  std::int64_t time_ns = 0;    ///< CLOCK_MONOTONIC
  std::string name;            ///< "state", "fault", "device", ...
  std::string level;           ///< "info", "warning", "error"
  std::string json;            ///< all of it, as a JSON object
};

/// A connection to wrenchd. Every call waits for its answer, and throws ClientError where there is none in
/// time, where the connection ended, and where the daemon refused, with the daemon's own sentence. Answers
/// are JSON texts, to be read by whatever the program reads JSON with. Any thread may call; calls take turns.
class Client {
 public:
  /// socket: of the daemon; empty: $WRENCHD_SOCKET, then /run/wrenchd/control.sock, then
  /// $XDG_RUNTIME_DIR/wrenchd/control.sock. Throws ClientError::kNoDaemon.
  explicit Client(const std::string& socket = {},
                  std::chrono::milliseconds answer_within = std::chrono::seconds(5));
  /// Ends the connection, and with it the lease: the daemon fades the force out.
  ~Client();
  Client(Client&& other) noexcept;
  Client& operator=(Client&& other) noexcept;

  /// Path of the socket at which the daemon was found.
  const std::string& socket() const noexcept;

  /// Any method that describe() lists. params and the result are JSON objects.
  std::string call(const std::string& method, const std::string& params = "{}");
  /// The same, for methods that hand over a descriptor: it is the caller's to close; -1 where none came.
  std::string call(const std::string& method, const std::string& params, int& descriptor);

  std::string describe() { return call("describe"); }
  std::string status() { return call("status"); }
  std::string devices() { return call("devices"); }
  std::string reload() { return call("reload"); }
  std::string state();  ///< of status(): "disarmed", "active"

  /// Events of these names from now on, or of all. Returns status() at that moment, as a snapshot.
  std::string subscribe(const std::vector<std::string>& names = {});
  void unsubscribe() { call("unsubscribe"); }
  /// The next event. False where none came in time.
  bool poll_event(ClientEvent& out, std::chrono::milliseconds timeout = std::chrono::seconds(1));

  /// The right to arm, which one client has at a time. From here on a thread of this object's says that the
  /// program lives, until release_lease(); where the program ends or loses its connection, the force fades
  /// out. A program that may hang while it lives should do that itself: call("lease.take"), and beat() in
  /// time.
  void acquire_lease();
  void release_lease();
  void heartbeat();

  void arm() { call("arm"); }  ///< only with the lease
  void disarm() { call("disarm"); }
  void stop() { call("stop"); }  ///< emergency stop; anybody may
  void acknowledge() { call("acknowledge"); }
  void reinitialize_proxy() { call("start_over"); }

  /// The state of every tick, through shared memory.
  StateReader open_state();

 private:
  class HeartbeatThread;

  std::shared_ptr<class ClientConnection> connection_;
  std::unique_ptr<HeartbeatThread> heartbeat_thread_;
};

}  // namespace wrenchd
