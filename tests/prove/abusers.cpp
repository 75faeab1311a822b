// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/prove/abusers.hpp"

#include <atomic>
#include <cerrno>
#include <csignal>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/prove/abused_daemon.hpp"

namespace wrenchd::test {
namespace {

/// One kind of abuse, repeated while it is wanted.
using Abuse = void (*)(const fs::path& path, const std::atomic<bool>& wanted);

void floods_requests(const fs::path& path, const std::atomic<bool>& wanted) {
  const OwnedFd fd = connected(path);
  std::string many;
  for (int i = 0; i < 50; ++i) many += request("describe");
  while (wanted && fd && send_bytes(fd.get(), many)) drain(fd.get());
}

void never_reads(const fs::path& path, const std::atomic<bool>& wanted) {
  const OwnedFd fd = connected(path);
  const std::string line = request("subscribe") + request("status") + request("describe");
  while (wanted && fd && send_bytes(fd.get(), line)) {
  }
}

void floods_rubbish(const fs::path& path, const std::atomic<bool>& wanted) {
  const OwnedFd fd = connected(path);
  const std::string rubbish = std::string(40000, '[') + "\n{\"jsonrpc\":\"2.0\",\n\xff\xfe\n";
  while (wanted && fd && send_bytes(fd.get(), rubbish)) drain(fd.get());
}

void endless_line(const fs::path& path, const std::atomic<bool>& wanted) {
  const std::string piece(65536, 'x');
  while (wanted) {
    const OwnedFd fd = connected(path);
    if (!fd) return;
    for (int i = 0; i < 1600 && wanted && send_bytes(fd.get(), piece); ++i) {
    }
  }
}

void connects(const fs::path& path, const std::atomic<bool>& wanted) {
  std::vector<OwnedFd> kept;
  while (wanted) {
    kept.push_back(connected(path));
    if (kept.size() > 50) kept.clear();
    std::this_thread::sleep_for(100us);
  }
}

void asks_for_all(const fs::path& path, const std::atomic<bool>& wanted) {
  const OwnedFd fd = connected(path);
  const std::string line =
      request("devices") + request("arm") + request("lease.heartbeat") + request("lease.release");
  while (wanted && fd && send_bytes(fd.get(), line)) drain(fd.get());
}

/// In the order of kAbuseNames.
constexpr std::array<Abuse, kAbuseNames.size()> kAbuses = {floods_requests, never_reads, floods_rubbish,
                                                           endless_line,    connects,    asks_for_all};

}  // namespace

Abusers::Abusers(const fs::path& socket, int threads, uid_t uid) {
  if (::pipe2(pipe_.data(), O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category(), "pipe");
  pid_ = ::fork();
  if (pid_ == 0 && become(uid)) live(socket, threads);
  if (pid_ == 0) ::_exit(1);
  ::close(pipe_[0]);
}

Abusers::~Abusers() {
  ::close(pipe_[1]);
  ::kill(pid_, SIGKILL);
  ::waitpid(pid_, nullptr, 0);
}

void Abusers::send(char what) {
  [[maybe_unused]] const ssize_t n = ::write(pipe_[1], &what, 1);
}

void Abusers::live(const fs::path& socket, int threads) const {
  ::close(pipe_[1]);
  std::array<std::atomic<bool>, kAbuses.size()> wanted{};
  for (int i = 0; i < threads; ++i) {
    const std::size_t kind = static_cast<std::size_t>(i) % kAbuses.size();
    std::thread([&wanted, socket, kind] {
      while (true) {
        while (!wanted[kind]) std::this_thread::sleep_for(1ms);
        kAbuses[kind](socket, wanted[kind]);
        std::this_thread::sleep_for(1ms);
      }
    }).detach();
  }
  for (char what = 0; ::read(pipe_[0], &what, 1) == 1;)
    for (std::size_t kind = 0; kind < wanted.size(); ++kind)
      wanted[kind] = what == kAll || what == static_cast<char>(kind);
  ::_exit(0);
}

Decoy::Decoy(const fs::path& socket) : listens_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  socket.native().copy(address.sun_path, sizeof address.sun_path - 1);
  if (::bind(listens_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
      ::listen(listens_.get(), 64) != 0)
    throw std::system_error(errno, std::generic_category(), socket.string());
  fs::permissions(socket, fs::perms::all);
  pid_ = ::fork();
  if (pid_ == 0) live();
}

Decoy::~Decoy() {
  ::kill(pid_, SIGKILL);
  ::waitpid(pid_, nullptr, 0);
}

void Decoy::live() const {
  std::vector<pollfd> peers = {{listens_.get(), POLLIN, 0}};
  std::array<char, 65536> bytes;
  while (::poll(peers.data(), peers.size(), -1) > 0 || errno == EINTR) {
    for (std::size_t i = peers.size() - 1; i > 0; --i) {
      if (peers[i].revents == 0) continue;
      const ssize_t got = ::recv(peers[i].fd, bytes.data(), bytes.size(), MSG_DONTWAIT);
      if (got > 0 || (got < 0 && errno == EAGAIN)) continue;
      ::close(peers[i].fd);
      peers.erase(peers.begin() + static_cast<std::ptrdiff_t>(i));
    }
    if (peers[0].revents == 0) continue;
    const int peer = ::accept4(listens_.get(), nullptr, nullptr, SOCK_CLOEXEC);
    if (peer >= 0) peers.push_back({peer, POLLIN, 0});
  }
  ::_exit(1);
}

}  // namespace wrenchd::test
