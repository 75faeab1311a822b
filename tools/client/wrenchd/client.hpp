// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include <wrenchd/client_error.hpp>
#include <wrenchd/state_reader.hpp>

namespace wrenchd {

/// An event that the daemon sent to its subscribers.
struct ClientEvent {
  std::uint64_t sequence = 0;  ///< event counter; a gap means that the daemon dropped events
  std::int64_t time_ns = 0;    ///< CLOCK_MONOTONIC
  std::string name;            ///< "state", "fault", "device", ...
  std::string level;           ///< "info", "warning", "error"
  std::string json;            ///< the whole event as a JSON object
};

/// A connection to wrenchd. Every call waits for its response. A call throws ClientError if the response is
/// late, if the connection has ended, or if the daemon rejects the request; the error then contains the
/// daemon's message. Results are JSON texts. Thread-safe: calls from several threads run one after the other.
/// Not RT-safe: calls wait for the daemon.
class Client {
 public:
  /// Connects to a daemon. socket: path of the daemon's socket; if empty, the first of $WRENCHD_SOCKET,
  /// /run/wrenchd/control.sock and $XDG_RUNTIME_DIR/wrenchd/control.sock. Throws ClientError::kNoDaemon.
  explicit Client(const std::string& socket = {},
                  std::chrono::milliseconds answer_within = std::chrono::seconds(5));
  /// Closes the connection and thereby ends the lease: the daemon fades the force out.
  ~Client();
  Client(Client&& other) noexcept;
  Client& operator=(Client&& other) noexcept;

  /// Returns the path of the daemon's socket.
  const std::string& socket() const noexcept;

  /// Calls any method that describe() lists. params and the result are JSON objects.
  std::string call(const std::string& method, const std::string& params = "{}");
  /// Calls a method that returns a file descriptor. The caller must close it; -1 if the response has none.
  std::string call(const std::string& method, const std::string& params, int& descriptor);

  std::string describe() { return call("describe"); }
  std::string status() { return call("status"); }
  std::string devices() { return call("devices"); }
  std::string reload() { return call("reload"); }
  std::string state();  ///< state of the servo loop, such as "disarmed" or "active"

  /// Subscribes to events with these names, or to all events. Returns status() at that moment.
  std::string subscribe(const std::vector<std::string>& names = {});
  void unsubscribe() { call("unsubscribe"); }
  /// Receives the next event. Returns false if none came in time.
  bool poll_event(ClientEvent& out, std::chrono::milliseconds timeout = std::chrono::seconds(1));

  /// Acquires the lease, which is the right to arm; one client holds it at a time. A thread of this object
  /// sends heartbeats until release_lease(). If the program ends or loses its connection, the force fades
  /// out. A program that may hang should not use that thread: call("lease.acquire") and call heartbeat() in
  /// time.
  void acquire_lease();
  void release_lease();
  void heartbeat();

  void arm() { call("arm"); }  ///< requires the lease
  void disarm() { call("disarm"); }
  void stop() { call("stop"); }  ///< emergency stop; requires no lease
  void acknowledge() { call("acknowledge"); }
  void reinitialize_proxy() { call("reinitialize_proxy"); }
  /// The tool holds the free body that it touches, or the first one that it will touch.
  void grasp() { call("grasp"); }
  void let_go() { call("let_go"); }  ///< the force of the body's weight fades out within 150 ms

  /// Moves the hand of a simulated device to a pose in the device base: position [m], rotation vector [rad].
  /// Call it again before it expires; afterwards the hand returns to its path. Throws ClientError for a
  /// device that a person moves.
  void move_hand(const std::array<double, 3>& position_m,
                 const std::array<double, 3>& rotation_vector_rad = {},
                 std::chrono::milliseconds expires_after = std::chrono::milliseconds(500));

  /// Acts on the hand: force [N] and torque about the handle point [N.m], in axes of the world. energy_J:
  /// that the wrench may give to the hand from now on [J], beside what the hand gave to it. Call it again
  /// before it expires; then the wrench fades out within 50 ms. Throws ClientError if a value exceeds its
  /// limit, or if another program acts on the hand.
  void set_wrench(const std::array<double, 3>& force_N, const std::array<double, 3>& torque_Nm = {},
                  double energy_J = 0.0,
                  std::chrono::milliseconds expires_after = std::chrono::milliseconds(100));

  /// Value of a condition of an experiment.
  using Condition = std::variant<double, std::string>;
  /// Sets a marker in the running recording: mark("trial 3", {{"stiffness", 2000.0}}). A condition holds
  /// until the next marker changes it. Throws ClientError if no recording runs, or if the marker exceeds its
  /// bounds (see `record.mark` in describe()).
  void mark(const std::string& label, const std::map<std::string, Condition>& conditions = {});

  /// Opens the shared memory that contains the state of every tick.
  StateReader open_state();

 private:
  class HeartbeatThread;

  std::shared_ptr<class ClientConnection> connection_;
  std::unique_ptr<HeartbeatThread> heartbeat_thread_;
};

}  // namespace wrenchd
