// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/stub_daemon.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <stdexcept>

#include <nlohmann/json.hpp>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "core/fault.hpp"
#include "daemon/control/state_layout.hpp"
#include "daemon/realtime.hpp"
#include "daemon/servo/shared_state.hpp"

namespace wrenchd::test {
namespace {

using nlohmann::json;

struct Rejection {
  int code;
  std::string message;
};

int listen_at(const std::string& path) {
  const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof(address.sun_path)) throw std::runtime_error(path + " is too long for a socket");
  std::memcpy(address.sun_path, path.data(), path.size());
  if (bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0 || listen(fd, 8) != 0)
    throw std::runtime_error(path + ": " + std::strerror(errno));
  return fd;
}

/// Sends the descriptor with the first byte.
void send_line(int peer, const std::string& line, int descriptor = -1) {
  iovec part = {const_cast<char*>(line.data()), line.size()};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> ancillary{};
  if (descriptor >= 0) {
    message.msg_control = ancillary.data();
    message.msg_controllen = ancillary.size();
    cmsghdr* const rights = CMSG_FIRSTHDR(&message);
    rights->cmsg_level = SOL_SOCKET;
    rights->cmsg_type = SCM_RIGHTS;
    rights->cmsg_len = CMSG_LEN(sizeof(int));
    std::memcpy(CMSG_DATA(rights), &descriptor, sizeof(int));
  }
  sendmsg(peer, &message, MSG_NOSIGNAL);
}

RunConfig stub_config() {
  RunConfig config = shipped_config();
  config.settings.servo.realtime = Realtime::best_effort;
  return config;
}

}  // namespace

StubDaemon::StubDaemon()
    : simulated_(stub_config()),
      state_(simulated_.runtime.enable_shared_state()),
      listening_(listen_at(socket())) {
  servo_ = std::thread([this] {
    prepare_servo_thread(simulated_.runtime.config().settings.servo);
    loop().run(simulated_.clock, stop_loop_);
  });
  while (loop().telemetry().state() == State::disconnected)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  serving_ = std::jthread([this](const std::stop_token& stop) { serve(stop); });
}

StubDaemon::~StubDaemon() {
  serving_.request_stop();
  serving_.join();
  disconnect_all();
  close(listening_);
  stop_loop_.store(true);
  servo_.join();
}

std::vector<std::string> StubDaemon::requested_methods() const {
  const std::lock_guard lock(mutex_);
  return requested_methods_;
}

void StubDaemon::send_event(const std::string& name, const std::string& level) {
  const std::lock_guard lock(mutex_);
  ++sequence_;
  const json event = {
      {"jsonrpc", "2.0"},
      {"method", "event"},
      {"params", {{"sequence", sequence_}, {"time_ns", 7}, {"name", name}, {"level", level}}}};
  for (const auto& [fd, peer] : peers_)
    if (peer.subscribed &&
        (peer.names.empty() || std::find(peer.names.begin(), peer.names.end(), name) != peer.names.end()))
      send_line(fd, event.dump() + "\n");
}

void StubDaemon::send_raw(const std::string& bytes) {
  const std::lock_guard lock(mutex_);
  for (const auto& [fd, peer] : peers_)
    for (std::size_t i = 0; i < bytes.size(); i += 3) send_line(fd, bytes.substr(i, 3));
}

void StubDaemon::expire_lease() {
  holder_.store(-1);
  loop().requests().disarm();
}

void StubDaemon::disconnect_all() {
  const std::lock_guard lock(mutex_);
  while (!peers_.empty()) disconnect(peers_.begin()->first);
}

void StubDaemon::disconnect(int peer) {
  peers_.erase(peer);
  close(peer);
  int held = peer;
  if (holder_.compare_exchange_strong(held, -1)) loop().requests().disarm();
}

void StubDaemon::serve(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    std::vector<pollfd> waited = {{listening_, POLLIN, 0}};
    {
      const std::lock_guard lock(mutex_);
      for (const auto& [fd, peer] : peers_) waited.push_back({fd, POLLIN, 0});
    }
    if (poll(waited.data(), waited.size(), 5) <= 0) continue;
    const std::lock_guard lock(mutex_);
    for (const pollfd& one : waited) {
      if (one.revents == 0) continue;
      if (one.fd == listening_)
        peers_[accept4(listening_, nullptr, nullptr, SOCK_CLOEXEC)];
      else if (peers_.count(one.fd) == 1 && !receive(one.fd))
        disconnect(one.fd);
    }
  }
}

bool StubDaemon::receive(int peer) {
  std::array<char, 4096> bytes;
  const ssize_t got = recv(peer, bytes.data(), bytes.size(), MSG_DONTWAIT);
  if (got <= 0) return false;
  std::string& received = peers_[peer].received;
  received.append(bytes.data(), static_cast<std::size_t>(got));
  for (std::size_t at; (at = received.find('\n')) != std::string::npos;) {
    const std::string line = received.substr(0, at);
    received.erase(0, at + 1);
    answer(peer, line);
  }
  return true;
}

void StubDaemon::answer(int peer, const std::string& line) {
  const json request = json::parse(line);
  const std::string method = request.at("method");
  if (method == "lease.heartbeat") {
    if (holder_.load() == peer) ++heartbeats_;
    loop().requests().heartbeat();
  } else {
    requested_methods_.push_back(method);
  }
  if (!request.contains("id") || silent_.load()) return;
  json reply = {{"jsonrpc", "2.0"}, {"id", request["id"]}};
  int descriptor = -1;
  try {
    reply["result"] = result_of(peer, method, request.at("params"), descriptor);
  } catch (const Rejection& rejection) {
    reply["error"] = {{"code", rejection.code}, {"message", rejection.message}};
  }
  send_line(peer, reply.dump() + "\n", descriptor);
}

json StubDaemon::status() {
  json cause;
  if (const Fault fault = loop().telemetry().cause(); fault != Fault::none)
    cause = {{"name", fault_row(fault).name}, {"message", fault_row(fault).message}};
  return {{"state", name(loop().telemetry().state())}, {"cause", cause}, {"sequence", sequence_}};
}

json StubDaemon::result_of(int peer, const std::string& method, const json& params, int& descriptor) {
  const auto request = [&](CommandSet commands) -> json {
    loop().requests().request(commands);
    return {{"requested", method}};
  };
  if (method == "describe") return {{"protocol", 2}, {"methods", json::array()}};
  if (method == "status") return status();
  if (method == "devices") return json::array();
  if (method == "reload") throw Rejection{-32004, "wrenchd.toml:3: no such key; delete it"};
  if (method == "subscribe") {
    peers_[peer].subscribed = true;
    peers_[peer].names = params.value("events", std::vector<std::string>());
    return status();
  }
  if (method == "unsubscribe") {
    peers_[peer].subscribed = false;
    return json::object();
  }
  if (method == "lease.acquire") {
    int no_holder = -1;
    if (!holder_.compare_exchange_strong(no_holder, peer) && no_holder != peer)
      throw Rejection{-32003, "another client holds the lease; wait until it releases the lease"};
    return {{"heartbeat_timeout_s", 0.1}};
  }
  if (method == "lease.release") {
    int held = peer;
    if (!holder_.compare_exchange_strong(held, -1)) throw Rejection{-32002, "you do not hold the lease"};
    loop().requests().disarm();
    return json::object();
  }
  if (method == "arm") {
    if (holder_.load() != peer)
      throw Rejection{-32002, "you do not hold the lease; acquire it with 'lease.acquire'"};
    return request(kArm | kLease | kHeartbeat);
  }
  if (method == "disarm") return request(kDisarm);
  if (method == "stop") return request(kStop);
  if (method == "acknowledge") return request(kAcknowledge);
  if (method == "reinitialize_proxy") return request(kReinitialize);
  if (method == "grasp") return request(kGrasp);
  if (method == "let_go") return request(kLetGo);
  if (method == "hand.set") {
    const auto vector_of = [&params](const char* name) {
      return Vector3d(params[name][0], params[name][1], params[name][2]);
    };
    const TimePoint expires =
        std::chrono::steady_clock::now() + from_seconds(params["expires_s"].get<double>());
    simulated_.simulated.set_hand_goal(
        {{rotation_from(vector_of("rotation_vector_rad")), vector_of("position_m")}, expires});
    return {{"expires_ns", expires.time_since_epoch().count()}};
  }
  if (method == "state.open") {
    json answer;
    open_state(state_, simulated_.runtime.reconfigurator().obstacle_names(),
               [&](const json& result, int memory) {
                 answer = result;
                 descriptor = memory;
               });
    return answer;
  }
  throw Rejection{-32601, "there is no method '" + method + "'; describe lists them"};
}

}  // namespace wrenchd::test
