// SPDX-License-Identifier: GPL-3.0-or-later
#include "client_connection.hpp"

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <utility>
#include <vector>

#include <grp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>
#include <wrenchd/client_error.hpp>

namespace wrenchd {
namespace {

using nlohmann::json;

constexpr std::size_t kMaxLineBytes = 16U << 20;
/// Maximum number of stored events. If there are more, the oldest is dropped.
constexpr std::size_t kMaxEvents = 10'000;

[[noreturn]] void fail(const std::string& why) {
  throw ClientError(ClientError::kDisconnected,
                    "wrenchd ended the connection (" + why + "); connect again when wrenchd is running");
}

std::vector<std::string> socket_paths(const std::string& socket) {
  if (!socket.empty()) return {socket};
  if (const char* set = std::getenv("WRENCHD_SOCKET"); set != nullptr && *set != '\0') return {set};
  std::vector<std::string> all = {"/run/wrenchd/control.sock"};
  if (const char* run = std::getenv("XDG_RUNTIME_DIR"); run != nullptr && *run != '\0')
    all.push_back(std::string(run) + "/wrenchd/control.sock");
  return all;
}

/// Returns 0, or the errno of the failure.
int try_to_connect(int descriptor, const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof(address.sun_path)) return ENAMETOOLONG;
  std::memcpy(address.sun_path, path.data(), path.size());
  return connect(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0 ? 0 : errno;
}

/// Returns the users that may connect, from the permissions of the socket file.
std::string permitted_users(const std::string& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0 || (status.st_mode & 0060U) == 0)
    return "only root and wrenchd's own user may connect; set 'observers' in [control] of "
           "wrenchd.toml to one of your groups";
  const struct group* group = getgrgid(status.st_gid);
  const std::string name = group != nullptr ? group->gr_name : std::to_string(status.st_gid);
  return "group '" + name + "' may connect; join it with: sudo usermod -aG " + name +
         " $USER, and log in again";
}

/// Connects to the named socket or to the default ones. found: receives the path of the daemon's socket.
int connect_socket(const std::string& socket, std::string& found) {
  const int descriptor = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (descriptor < 0)
    throw ClientError(ClientError::kNoDaemon, std::string("socket: ") + std::strerror(errno));
  std::string tried;
  for (const std::string& path : socket_paths(socket)) {
    const int error = try_to_connect(descriptor, path);
    if (error == 0) {
      found = path;
      return descriptor;
    }
    tried += (tried.empty() ? "" : "; ") + path + ": " + std::strerror(error);
    if (error == EACCES) tried += " (" + permitted_users(path) + ")";
  }
  close(descriptor);
  throw ClientError(ClientError::kNoDaemon,
                    "no wrenchd responds (" + tried + "); start it, or name its socket in WRENCHD_SOCKET");
}

}  // namespace

ClientConnection::ClientConnection(const std::string& socket, std::chrono::milliseconds answer_within)
    : socket_(connect_socket(socket, socket_path_)), response_timeout_(answer_within) {}

ClientConnection::~ClientConnection() {
  close_descriptor();
  close(socket_);
}

void ClientConnection::close_descriptor() noexcept {
  if (descriptor_ >= 0) close(descriptor_);
  descriptor_ = -1;
}

json ClientConnection::call(const std::string& method, const json& params, int* descriptor) {
  const auto end = Clock::now() + response_timeout_;
  const std::lock_guard lock(read_mutex_);
  close_descriptor();
  const std::int64_t id = ++last_id_;
  send({{"jsonrpc", "2.0"}, {"id", id}, {"method", method}, {"params", params}});
  for (std::string line;;) {
    if (!read_line(line, end))
      throw ClientError(ClientError::kTimeout, "wrenchd did not respond to '" + method + "' within " +
                                                   std::to_string(response_timeout_.count()) +
                                                   " ms; see its log");
    json message = json::parse(line, nullptr, false);
    if (!message.is_object())
      throw ClientError(ClientError::kProtocol, "the response is not wrenchd's: " + line.substr(0, 80));
    if (message.contains("method")) {
      queue_event(std::move(message));
      continue;
    }
    if (const auto error = message.find("error"); error != message.end()) {
      if (message.value("id", json()) != id && !message.value("id", json()).is_null()) continue;
      throw ClientError(error->value("code", int{ClientError::kProtocol}),
                        error->value("message", method + " was rejected"));
    }
    if (message.value("id", json()) != id) continue;  // response to a call that timed out
    if (descriptor != nullptr) *descriptor = std::exchange(descriptor_, -1);
    return message.value("result", json::object());
  }
}

void ClientConnection::notify(const std::string& method) {
  send({{"jsonrpc", "2.0"}, {"method", method}, {"params", json::object()}});
}

bool ClientConnection::poll_event(json& out, std::chrono::milliseconds timeout) {
  const auto end = Clock::now() + timeout;
  const std::lock_guard lock(read_mutex_);
  for (std::string line; events_.empty();) {
    if (!read_line(line, end)) return false;
    json message = json::parse(line, nullptr, false);
    if (message.is_object() && message.contains("method")) queue_event(std::move(message));
  }
  out = std::move(events_.front());
  events_.pop_front();
  return true;
}

void ClientConnection::queue_event(json message) {
  if (!message.contains("params")) return;
  if (events_.size() == kMaxEvents) events_.pop_front();
  events_.push_back(std::move(message["params"]));
}

/// Received data stays readable after the connection has ended.
bool ClientConnection::is_connected() const noexcept {
  pollfd here = {socket_, POLLRDHUP, 0};
  return poll(&here, 1, 0) >= 0 && (here.revents & (POLLRDHUP | POLLHUP | POLLERR)) == 0;
}

bool ClientConnection::wait_for(short events, Clock::time_point end) const {
  for (;;) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now());
    pollfd here = {socket_, events, 0};
    const int ready = poll(&here, 1, static_cast<int>(std::max<std::int64_t>(left.count(), 0)));
    if (ready > 0) return true;
    if (ready == 0) return false;
    if (errno != EINTR) fail(std::strerror(errno));
  }
}

/// Returns false if no complete line came in time.
bool ClientConnection::read_line(std::string& line, Clock::time_point end) {
  for (;;) {
    const std::size_t at = received_.find('\n', scanned_);
    if (at != std::string::npos) {
      line = received_.substr(0, at);
      received_.erase(0, at + 1);
      scanned_ = 0;
      return true;
    }
    scanned_ = received_.size();
    if (received_.size() > kMaxLineBytes) fail("an overlong line");
    if (!wait_for(POLLIN, end)) return false;
    receive();
  }
}

void ClientConnection::receive() {
  std::array<char, 65536> bytes;
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> ancillary{};
  iovec part = {bytes.data(), bytes.size()};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = ancillary.data();
  message.msg_controllen = ancillary.size();
  const ssize_t got = recvmsg(socket_, &message, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
  if (got == 0) fail("end of file");
  if (got < 0) {
    if (errno == EAGAIN || errno == EINTR) return;
    fail(std::strerror(errno));
  }
  for (cmsghdr* one = CMSG_FIRSTHDR(&message); one != nullptr; one = CMSG_NXTHDR(&message, one)) {
    if (one->cmsg_level != SOL_SOCKET || one->cmsg_type != SCM_RIGHTS) continue;
    close_descriptor();
    std::memcpy(&descriptor_, CMSG_DATA(one), sizeof(int));
  }
  received_.append(bytes.data(), static_cast<std::size_t>(got));
}

void ClientConnection::send(const json& request) {
  const std::string line = request.dump() + "\n";
  const auto end = Clock::now() + response_timeout_;
  const std::lock_guard lock(write_mutex_);
  for (std::size_t sent = 0; sent < line.size();) {
    const ssize_t n = ::send(socket_, line.data() + sent, line.size() - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (n > 0) {
      sent += static_cast<std::size_t>(n);
      continue;
    }
    if (errno == EINTR) continue;
    if (errno != EAGAIN) fail(std::strerror(errno));
    if (!wait_for(POLLOUT, end)) fail("wrenchd accepts no more requests");
  }
}

}  // namespace wrenchd
