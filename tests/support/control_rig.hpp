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
#include "tests/support/shipped_config.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test {

/// Users that a rig's clients can be.
enum class TestUser : uid_t { stranger = 60001, observer = 60002, operator_ = 60003, administrator = 60004 };

/// A client that can misbehave. Its address tells the rig who it wants to be.
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

  /// As much as goes, within a second. False: the other side has hung up, or reads no more.
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

  /// The next line, without its end; nothing: it did not come in time, or the other side has hung up.
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
  /// The other side has hung up, as far as line() has seen.
  bool closed_by_peer() const noexcept { return closed_by_peer_; }

  /// Asks, and waits for the answer to that; events meanwhile are kept. The whole reply; null: none came.
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
  /// The code of the error that it answers; 0: none.
  int error_code(const std::string& method, const Json& params = Json::object()) {
    const Json reply = request(method, params);
    return reply.is_object() && reply.contains("error") ? reply["error"]["code"].get<int>() : 0;
  }
  void heartbeat() { send("{\"jsonrpc\":\"2.0\",\"method\":\"beat\"}\n"); }
  /// The next event of that name; null: it did not come in time.
  Json next_event(const std::string& name, std::chrono::milliseconds limit = std::chrono::seconds(5)) {
    while (true) {
      while (!events.empty()) {
        Json first = events.front();
        events.pop_front();
        if (first["name"] == name) return first;
      }
      const auto text = read_line(limit);
      if (!text) return nullptr;
      Json told = Json::parse(*text);
      if (told.contains("method")) events.push_back(told["params"]);
    }
  }

  std::deque<Json> events;

 private:
  OwnedFd fd_;
  std::string received_;
  bool closed_by_peer_ = false;
  int last_id_ = 0;
};

/// Above the table, and still: one that can be armed.
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

/// A real servo loop in a thread, with its simulated device, behind a real control socket. Who connects says
/// who it is.
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

  /// A fault that the machine made, by letting the loop wait, is acknowledged; a stop is not.
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
    if (uid == static_cast<uid_t>(TestUser::administrator)) peer.groups = {1};  // daemon
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
