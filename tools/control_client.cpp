// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/control_client.hpp"

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <vector>

#include <grp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

namespace wrenchd {
namespace {

using namespace std::chrono_literals;

/// What takes longest, a mesh of a million triangles, takes less.
constexpr auto kAnswerWithin = 60s;

std::vector<std::string> usual_places() {
  std::vector<std::string> places;
  if (const char* named = std::getenv("WRENCHD_SOCKET"); named && *named) return {named};
  places.emplace_back("/run/wrenchd/control.sock");
  if (const char* run = std::getenv("XDG_RUNTIME_DIR"); run && *run)
    places.push_back(std::string(run) + "/wrenchd/control.sock");
  return places;
}

/// Who may connect there, from the file.
std::string who_may(const std::string& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0 || (status.st_mode & 0060U) == 0)
    return "only the user that wrenchd runs as, and root, may; set 'observers' under [control] in "
           "wrenchd.toml to "
           "a group of yours";
  const struct group* group = getgrgid(status.st_gid);
  const std::string name = group ? group->gr_name : std::to_string(status.st_gid);
  return "group '" + name + "' may; add yourself to it with: sudo usermod -aG " + name +
         " $USER, and log in anew";
}

}  // namespace

ControlClient::ControlClient(const std::string& path) {
  const std::vector<std::string> places = path.empty() ? usual_places() : std::vector{path};
  std::string tried;
  for (const std::string& place : places) {
    if (connect_to(place)) return;
    const int error = errno;
    if (error == EACCES) throw std::runtime_error(place + ": you may not connect: " + who_may(place));
    tried += (tried.empty() ? "" : ", ") + place + " (" + std::strerror(error) + ")";
  }
  throw std::runtime_error("no wrenchd answers at " + tried +
                           "; start it, with: systemctl start wrenchd, or name its socket with --socket");
}

/// errno says why not.
bool ControlClient::connect_to(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof address.sun_path) {
    errno = ENAMETOOLONG;
    return false;
  }
  path.copy(address.sun_path, sizeof address.sun_path - 1);
  OwnedFd socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (!socket || ::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    return false;
  path_ = path;
  socket_ = std::move(socket);
  return true;
}

void ControlClient::send(const std::string& line) {
  for (std::size_t sent = 0; sent < line.size();) {
    const ssize_t more = ::send(socket_.get(), line.data() + sent, line.size() - sent, MSG_NOSIGNAL);
    if (more > 0) sent += static_cast<std::size_t>(more);
    if (more < 0 && errno != EINTR)
      throw std::runtime_error(path_ + ": wrenchd has hung up: " + std::strerror(errno));
  }
}

std::optional<std::string> ControlClient::line(std::chrono::milliseconds limit) {
  const auto end = std::chrono::steady_clock::now() + limit;
  while (true) {
    if (const auto at = in_.find('\n'); at != std::string::npos) {
      std::string first = in_.substr(0, at);
      in_.erase(0, at + 1);
      return first;
    }
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    pollfd readable{socket_.get(), POLLIN, 0};
    if (left <= 0ms || ::poll(&readable, 1, static_cast<int>(left.count())) <= 0) return {};
    std::array<char, 65536> bytes;
    const ssize_t got = ::recv(socket_.get(), bytes.data(), bytes.size(), 0);
    if (got < 0 && errno == EINTR) return {};
    if (got <= 0) throw std::runtime_error(path_ + ": wrenchd has hung up; see its log");
    in_.append(bytes.data(), static_cast<std::size_t>(got));
  }
}

Json ControlClient::call(const std::string& method, const Json& params) {
  const int id = ++last_id_;
  send(request_line(id, method, params));
  const auto end = std::chrono::steady_clock::now() + kAnswerWithin;
  while (std::chrono::steady_clock::now() < end) {
    const auto text = line(100ms);
    if (!text) continue;
    Json reply = Json::parse(*text, nullptr, false);
    if (!reply.is_object()) throw std::runtime_error(path_ + ": what answers is no wrenchd");
    if (reply.contains("method")) events_.push_back(std::move(reply["params"]));
    // Where nobody knows whose error it is, it is ours.
    if (!reply.contains("id") || (reply["id"] != id && !reply["id"].is_null())) continue;
    if (reply.contains("result")) return std::move(reply["result"]);
    const Json error = reply.value("error", Json::object());
    throw RpcError(static_cast<RpcCode>(error.value("code", 0)), error.value("message", "no reason given"),
                   error.value("data", Json(nullptr)));
  }
  throw std::runtime_error(path_ + ": wrenchd does not answer");
}

void ControlClient::say(const std::string& method) {
  send(notification_line(method, Json::object()));
}

std::optional<Json> ControlClient::event(std::chrono::milliseconds limit) {
  if (events_.empty()) {
    const auto text = line(limit);
    if (!text) return {};
    Json told = Json::parse(*text, nullptr, false);
    if (!told.is_object() || !told.contains("method")) return {};
    events_.push_back(std::move(told["params"]));
  }
  Json first = std::move(events_.front());
  events_.pop_front();
  return first;
}

}  // namespace wrenchd
