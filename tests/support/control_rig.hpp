// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <chrono>
#include <deque>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <grp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "daemon/control/control_interface.hpp"
#include "daemon/realtime.hpp"
#include "daemon/wall_clock.hpp"
#include "tests/support/request_line.hpp"
#include "tests/support/shipped_config.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test {

/// Users that a rig's clients can have.
enum class TestUser : uid_t { stranger = 60001, observer = 60002, operator_ = 60003, administrator = 60004 };

/// A client that can misbehave. Its socket address tells the rig which user it represents.
class RigClient {
 public:
  RigClient(const std::filesystem::path& path, TestUser who) : RigClient(path, static_cast<uid_t>(who)) {}
  RigClient(const std::filesystem::path& path, uid_t uid)
      : fd_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    static std::atomic<int> number{0};
    sockaddr_un own{};
    own.sun_family = AF_UNIX;
    const std::string name = "wrenchd-rig-" + std::to_string(getpid()) + "-" + std::to_string(++number) +
                             "-" + std::to_string(uid);
    name.copy(own.sun_path + 1, name.size());
    if (::bind(fd_.get(), reinterpret_cast<const sockaddr*>(&own),
               static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size())) != 0)
      throw std::runtime_error("bind");
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.native().copy(address.sun_path, sizeof address.sun_path - 1);
    if (::connect(fd_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
      throw std::runtime_error("connect");
  }

  int fd() const noexcept { return fd_.get(); }
  void disconnect() noexcept { fd_.reset(); }

  /// Sends as many bytes as possible within 1 s. Returns false if the daemon has closed the connection or
  /// does not read.
  bool send(std::string_view bytes) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(1);
    while (!bytes.empty() && std::chrono::steady_clock::now() < end) {
      const ssize_t sent = ::send(fd_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
      if (sent > 0) {
        bytes.remove_prefix(static_cast<std::size_t>(sent));
        continue;
      }
      if (errno != EAGAIN) return false;
      pollfd writable{fd_.get(), POLLOUT, 0};
      ::poll(&writable, 1, 10);
    }
    return bytes.empty();
  }

  /// Returns the next line without its end; empty if none came in time or the daemon has closed the
  /// connection.
  std::optional<std::string> read_line(std::chrono::milliseconds limit = std::chrono::seconds(5)) {
    const auto end = std::chrono::steady_clock::now() + limit;
    while (true) {
      if (const auto at = received_.find('\n'); at != std::string::npos) {
        std::string first = received_.substr(0, at);
        received_.erase(0, at + 1);
        return first;
      }
      const auto left =
          std::chrono::duration_cast<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
      pollfd readable{fd_.get(), POLLIN, 0};
      if (left.count() <= 0 || ::poll(&readable, 1, static_cast<int>(left.count())) <= 0) return {};
      char bytes[65536];
      const ssize_t got = ::recv(fd_.get(), bytes, sizeof bytes, 0);
      if (got <= 0) {
        closed_by_peer_ = true;
        return {};
      }
      received_.append(bytes, static_cast<std::size_t>(got));
    }
  }
  /// Returns true if read_line() found the connection closed by the daemon.
  bool closed_by_peer() const noexcept { return closed_by_peer_; }

  /// Sends a request and returns its whole response; null if none came. Stores events that arrive before it.
  Json request(const std::string& method, const Json& params = Json::object()) {
    const int id = ++last_id_;
    if (!send(request_line(id, method, params))) return nullptr;
    while (const auto text = read_line()) {
      Json reply = Json::parse(*text);
      if (reply.contains("id") && reply["id"] == id) return reply;
      if (reply.contains("method")) events.push_back(reply["params"]);
    }
    return nullptr;
  }
  Json result(const std::string& method, const Json& params = Json::object()) {
    const Json reply = request(method, params);
    if (!reply.is_object() || !reply.contains("result"))
      throw std::runtime_error(method + ": " + reply.dump());
    return reply["result"];
  }
  /// Sends a request and returns the error code of its response; 0 if there is no error.
  int error_code(const std::string& method, const Json& params = Json::object()) {
    const Json reply = request(method, params);
    return reply.is_object() && reply.contains("error") ? reply["error"]["code"].get<int>() : 0;
  }
  void heartbeat() { send("{\"jsonrpc\":\"2.0\",\"method\":\"lease.heartbeat\"}\n"); }
  /// Returns the next event with this name; null if none came in time.
  Json next_event(const std::string& name, std::chrono::milliseconds limit = std::chrono::seconds(5)) {
    while (true) {
      while (!events.empty()) {
        Json first = events.front();
        events.pop_front();
        if (first["name"] == name) return first;
      }
      const auto text = read_line(limit);
      if (!text) return nullptr;
      Json message = Json::parse(*text);
      if (message.contains("method")) events.push_back(message["params"]);
    }
  }

  std::deque<Json> events;

 private:
  OwnedFd fd_;
  std::string received_;
  bool closed_by_peer_ = false;
  int last_id_ = 0;
};

/// The hand rests above the table, so that the loop can be armed.
inline RunConfig resting_config() {
  RunConfig plan = shipped_config();
  plan.settings.servo.realtime = Realtime::best_effort;
  plan.settings.limits.soft_start_s = 0.25;
  plan.settings.simulation.hand_path = {{0.0, Vector3d(0.0, 0.0, 0.065), Vector3d::Zero()}};
  plan.settings.simulation.hand_repeats = false;
  const struct group* own = getgrgid(getegid());
  plan.settings.control.observers = "*";
  plan.settings.control.operators = own ? own->gr_name : "";
  plan.settings.control.administrators = "daemon";
  return plan;
}

/// A real servo loop in a thread with its simulated device, behind a real control socket. The client's
/// address selects the client's user.
class ControlRig {
 public:
  explicit ControlRig(const RunConfig& plan = resting_config(), const std::vector<MethodRow>& more = {})
      : runtime_(plan), feed_(runtime_.runtime.loop()), control_(runtime_.runtime, feed_) {
    for (const MethodRow& row : more) control_.methods().add(row);
    control_.open(path(), [](int socket) { return peer_of(socket); });
    servo_ = std::thread([this] {
      prepare_servo_thread(runtime_.runtime.config().settings.servo);
      runtime_.runtime.loop().run(runtime_.clock, stop_);
    });
    wait_for_state(State::disarmed);
  }
  ~ControlRig() {
    stop_ = true;
    servo_.join();
  }

  std::filesystem::path path() const { return files_.path() / "control.sock"; }
  RigClient connect(TestUser who) const { return {path(), who}; }
  ServoLoop& loop() { return runtime_.runtime.loop(); }
  EventFeed& feed() { return feed_; }
  State state() { return loop().telemetry().state(); }

  /// Waits until the loop is in this state. Acknowledges faults that a busy machine causes by delaying the
  /// loop, but not a stop.
  bool wait_for_state(State state, std::chrono::milliseconds limit = std::chrono::seconds(5)) {
    const auto end = std::chrono::steady_clock::now() + limit;
    while (loop().telemetry().state() != state && std::chrono::steady_clock::now() < end) {
      if (loop().telemetry().state() == State::fault) loop().requests().acknowledge();
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return loop().telemetry().state() == state;
  }

 private:
  static std::optional<Peer> peer_of(int socket) {
    sockaddr_un address{};
    socklen_t length = sizeof address;
    if (getpeername(socket, reinterpret_cast<sockaddr*>(&address), &length) != 0) return {};
    const auto begin = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1);
    if (length <= begin) return {};
    const std::string name(address.sun_path + 1, length - begin);
    const auto uid = static_cast<uid_t>(std::stoul(name.substr(name.rfind('-') + 1)));
    if (uid == static_cast<uid_t>(TestUser::stranger)) return {};
    Peer peer{uid, 65534, {}, 1};
    if (uid == static_cast<uid_t>(TestUser::operator_)) peer.groups = {getegid()};
    if (uid == static_cast<uid_t>(TestUser::administrator)) peer.groups = {1};  // the daemon group
    return peer;
  }

  TemporaryDirectory files_;
  SimulatedRuntime<WallClock> runtime_;
  EventFeed feed_;
  ControlInterface control_;
  std::atomic<bool> stop_{false};
  std::thread servo_;
};

}  // namespace wrenchd::test
