// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/spacenav/spacenav_server.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>

#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

namespace wrenchd {
namespace {

std::runtime_error path_error(const std::filesystem::path& path, const std::string& text) {
  return std::runtime_error(path.string() + ": " + text);
}

sockaddr_un address_of(const std::filesystem::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.string().size() >= sizeof address.sun_path)
    throw path_error(path, "is too long for a socket; name a path of at most " +
                               std::to_string(sizeof address.sun_path - 1) + " characters with --serve");
  std::memcpy(static_cast<char*>(address.sun_path), path.c_str(), path.string().size());
  return address;
}

/// Removes the socket of a server that has died.
void remove_stale_socket(const std::filesystem::path& path, const sockaddr_un& address) {
  struct stat status {};
  if (::lstat(path.c_str(), &status) != 0) return;
  if (!S_ISSOCK(status.st_mode)) throw path_error(path, "is no socket; name another path with --serve");
  const OwnedFd probe(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (probe && ::connect(probe.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0)
    throw path_error(path,
                     "another program serves this socket; end it (systemctl stop spacenavd), or name another "
                     "path with --serve and in the environment variable SPNAV_SOCKET of your programs");
  if (errno != ECONNREFUSED)
    throw path_error(path, std::string("a socket is there and cannot be tested: ") + std::strerror(errno) +
                               "; remove it, or name another path with --serve");
  ::unlink(path.c_str());
}

/// Calls send(client) for all clients and forgets those that have gone.
template <class Send>
void send_to_all(std::vector<SpacenavClient>& clients, const Send& send) {
  std::erase_if(clients, [&](SpacenavClient& client) { return !send(client); });
}

}  // namespace

SpacenavServer::SpacenavServer(const std::filesystem::path& path, bool all_users) : path_(path) {
  const sockaddr_un address = address_of(path);
  remove_stale_socket(path, address);
  socket_ = OwnedFd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!socket_) throw path_error(path, std::strerror(errno));
  const mode_t before = ::umask(all_users ? 0111 : 0177);
  const int bound = ::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address);
  const int error = errno;
  ::umask(before);
  if (bound != 0)
    throw path_error(path, std::string("cannot be created: ") + std::strerror(error) +
                               "; name a path in a directory of your own with --serve");
  struct stat status {};
  if (::lstat(path.c_str(), &status) == 0) {
    device_ = status.st_dev;
    inode_ = status.st_ino;
  }
  if (::listen(socket_.get(), 8) != 0) throw path_error(path, std::strerror(errno));
}

SpacenavServer::~SpacenavServer() {
  struct stat status {};
  if (::lstat(path_.c_str(), &status) == 0 && status.st_dev == device_ && status.st_ino == inode_)
    ::unlink(path_.c_str());
}

void SpacenavServer::serve(const SpacenavDevice& device, std::chrono::milliseconds time, int end_fd) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + time;
  for (;;) {
    std::vector<pollfd> watched = {{end_fd, POLLIN, 0}};
    for (const SpacenavClient& client : clients_) watched.push_back({client.fd(), POLLIN, 0});
    // With all places taken, the listening socket is not polled: new programs wait in the kernel's queue.
    if (clients_.size() < kMostClients) watched.push_back({socket_.get(), POLLIN, 0});
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now());
    const int ready =
        ::poll(watched.data(), watched.size(), static_cast<int>(std::max<long>(0, left.count())));
    if (ready > 0) {
      std::size_t i = 1;
      const std::size_t count = clients_.size();
      send_to_all(clients_,
                  [&](SpacenavClient& client) { return watched[i++].revents == 0 || client.serve(device); });
      if (watched.size() > count + 1 && watched.back().revents != 0) accept_client();
      if (watched.front().revents != 0) return;
    }
    if (Clock::now() >= end) return;
  }
}

void SpacenavServer::accept_client() {
  OwnedFd client(::accept4(socket_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
  if (client) clients_.emplace_back(std::move(client));
}

void SpacenavServer::send_motion(const AxisRates& rates, double dt_s) {
  send_to_all(clients_, [&](SpacenavClient& client) { return client.send_motion(rates, dt_s); });
}

void SpacenavServer::send_button(int number, bool pressed) {
  send_to_all(clients_, [&](SpacenavClient& client) { return client.send_button(number, pressed); });
}

void SpacenavServer::send_device_change(bool connected) {
  send_to_all(clients_, [&](SpacenavClient& client) { return client.send_device_change(connected); });
}

}  // namespace wrenchd
