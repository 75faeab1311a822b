// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/links/socket_link.hpp"

#include <cerrno>
#include <stdexcept>
#include <string>

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>

#include "devices/links/wake_up.hpp"

namespace wrenchd {
namespace {

/// Each call is non-blocking by its flags, because the parent process shares the flags of the descriptor.
constexpr int kNonBlocking = MSG_DONTWAIT | MSG_NOSIGNAL;

[[noreturn]] void reject_socket(int socket, const std::string& why) {
  throw std::runtime_error("device socket " + std::to_string(socket) + ": " + why);
}

bool peer_closed(int socket) noexcept {
  pollfd state{socket, POLLIN, 0};
  return poll(&state, 1, 0) > 0 && (state.revents & (POLLHUP | POLLERR | POLLNVAL)) != 0;
}

LinkStatus send_report(int socket, std::span<const std::uint8_t> report) noexcept {
  for (;;) {
    if (send(socket, report.data(), report.size(), kNonBlocking) >= 0) return LinkStatus::ok;
    if (errno == EINTR) continue;
    const bool full = errno == EAGAIN || errno == EWOULDBLOCK || errno == ENOBUFS;
    return full ? LinkStatus::not_ready : LinkStatus::disconnected;
  }
}

}  // namespace

SocketLink::~SocketLink() {
  close();
  if (socket_ >= 0) ::close(socket_);
}

void SocketLink::open() {
  int type = 0;
  socklen_t size = sizeof type;
  if (getsockopt(socket_, SOL_SOCKET, SO_TYPE, &type, &size) != 0 || type != SOCK_SEQPACKET)
    reject_socket(socket_,
                  "is no SOCK_SEQPACKET socket; the parent process must pass one end of a socketpair()");
  fcntl(socket_, F_SETFD, FD_CLOEXEC);  // child processes must not inherit the device
  if (peer_closed(socket_)) reject_socket(socket_, "the other end is closed; restart both programs");
  writer_.emplace([socket = socket_](auto report) { return send_report(socket, report); }, settings_);
}

LinkRead SocketLink::read(TimePoint now, std::span<std::uint8_t> buffer) noexcept {
  if (!writer_) return {LinkStatus::disconnected, 0, now};
  for (;;) {
    const ssize_t length = recv(socket_, buffer.data(), buffer.size(), kNonBlocking | MSG_TRUNC);
    if (length > 0) return {LinkStatus::ok, static_cast<std::size_t>(length), now};
    if (length < 0 && errno == EINTR) continue;
    if (length < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return {LinkStatus::not_ready, 0, now};
    // length 0 means end of the connection, or an empty report
    if (length < 0 || peer_closed(socket_)) return {LinkStatus::disconnected, 0, now};
    return {LinkStatus::ok, 0, now};
  }
}

LinkStatus SocketLink::write(TimePoint now, std::span<const std::uint8_t> report) noexcept {
  return writer_ ? writer_->submit(now, report) : LinkStatus::disconnected;
}

void SocketLink::wait_readable(TimePoint deadline) noexcept {
  if (writer_) wait_for_fd(socket_, POLLIN, deadline);
}

}  // namespace wrenchd
