// SPDX-License-Identifier: GPL-3.0-or-later
#include <condition_variable>
#include <mutex>
#include <stop_token>
#include <thread>
#include <utility>

#include <nlohmann/json.hpp>
#include <wrenchd/client.hpp>

#include "client_connection.hpp"

namespace wrenchd {
namespace {

using nlohmann::json;

/// Number of heartbeats within the daemon's heartbeat timeout.
constexpr double kHeartbeatsPerTimeout = 4.0;

}  // namespace

/// The thread that sends heartbeats. The thread ends when the connection ends.
class Client::HeartbeatThread {
 public:
  HeartbeatThread(std::shared_ptr<ClientConnection> connection, std::chrono::duration<double> every)
      : thread_([connection = std::move(connection), every](const std::stop_token& stop) {
          std::mutex mutex;
          std::condition_variable_any ended;
          std::unique_lock lock(mutex);
          while (!stop.stop_requested()) {
            try {
              connection->notify("lease.heartbeat");
            } catch (const ClientError&) {
              return;  // the next call reports the error
            }
            ended.wait_for(lock, stop, every, [] { return false; });
          }
        }) {}

 private:
  std::jthread thread_;
};

Client::Client(const std::string& socket, std::chrono::milliseconds answer_within)
    : connection_(std::make_shared<ClientConnection>(socket, answer_within)) {}
Client::~Client() = default;
Client::Client(Client&& other) noexcept = default;
Client& Client::operator=(Client&& other) noexcept = default;

const std::string& Client::socket() const noexcept {
  return connection_->socket_path();
}

namespace {

json parameters(const std::string& method, const std::string& params) {
  json parsed = json::parse(params, nullptr, false);
  if (!parsed.is_object())
    throw ClientError(ClientError::kProtocol,
                      "the parameters of '" + method + "' are not a JSON object: " + params);
  return parsed;
}

}  // namespace

std::string Client::call(const std::string& method, const std::string& params) {
  return connection_->call(method, parameters(method, params)).dump();
}

std::string Client::call(const std::string& method, const std::string& params, int& descriptor) {
  descriptor = -1;
  return connection_->call(method, parameters(method, params), &descriptor).dump();
}

void Client::mark(const std::string& label, const std::map<std::string, Condition>& conditions) {
  json params = {{"label", label}};
  for (const auto& [name, value] : conditions)
    std::visit([&params, &name = name](const auto& one) { params["conditions"][name] = one; }, value);
  connection_->call("record.mark", params);
}

void Client::move_hand(const std::array<double, 3>& position_m,
                       const std::array<double, 3>& rotation_vector_rad,
                       std::chrono::milliseconds expires_after) {
  connection_->call("hand.set", {{"position_m", position_m},
                                 {"rotation_vector_rad", rotation_vector_rad},
                                 {"expires_s", 1e-3 * static_cast<double>(expires_after.count())}});
}

void Client::set_wrench(const std::array<double, 3>& force_N, const std::array<double, 3>& torque_Nm,
                        double energy_J, std::chrono::milliseconds expires_after) {
  connection_->call("wrench.set", {{"force_N", force_N},
                                   {"torque_Nm", torque_Nm},
                                   {"energy_J", energy_J},
                                   {"expires_s", 1e-3 * static_cast<double>(expires_after.count())}});
}

std::string Client::state() {
  return connection_->call("status", json::object()).value("state", "unknown");
}

std::string Client::subscribe(const std::vector<std::string>& names) {
  json params = json::object();
  if (!names.empty()) params["events"] = names;
  return connection_->call("subscribe", params).dump();
}

bool Client::poll_event(ClientEvent& out, std::chrono::milliseconds timeout) {
  json event;
  if (!connection_->poll_event(event, timeout)) return false;
  out.sequence = event.value("sequence", std::uint64_t{0});
  out.time_ns = event.value("time_ns", std::int64_t{0});
  out.name = event.value("name", "");
  out.level = event.value("level", "");
  out.json = event.dump();
  return true;
}

void Client::acquire_lease() {
  const json lease = connection_->call("lease.acquire", json::object());
  const std::chrono::duration<double> within(lease.value("heartbeat_timeout_s", 0.1));
  heartbeat_thread_ = std::make_unique<HeartbeatThread>(connection_, within / kHeartbeatsPerTimeout);
}

void Client::release_lease() {
  heartbeat_thread_.reset();
  try {
    call("lease.release");
  } catch (const ClientError& error) {  // the lease ended before, so there is nothing to release
    if (error.code() != ClientError::kInvalidState && error.code() != ClientError::kLeaseHeld) throw;
  }
}

void Client::heartbeat() {
  connection_->notify("lease.heartbeat");
}

StateReader Client::open_state() {
  int descriptor = -1;
  const json answer = connection_->call("state.open", json::object(), &descriptor);
  if (descriptor < 0 || !answer.contains("layout"))
    throw ClientError(ClientError::kProtocol, "wrenchd sent no shared memory; see its log");
  return StateReader(
      answer["layout"].dump(), descriptor, [connection = connection_] { return connection->is_connected(); },
      [connection = connection_] {
        return connection->call("state.obstacles", json::object(), nullptr).dump();
      });
}

}  // namespace wrenchd
