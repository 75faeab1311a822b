// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/listening_socket.hpp"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <utility>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFile = "control.sock";
/// Connections that wait to be accepted. Further clients wait in connect().
constexpr int kBacklog = 64;

std::string reason() {
  return std::strerror(errno);
}

std::runtime_error path_error(const fs::path& path, const std::string& error) {
  return std::runtime_error(path.string() + ": " + error);
}

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value ? value : "";
}

sockaddr_un address_of(const fs::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string& text = path.native();
  if (text.size() >= sizeof address.sun_path)
    throw path_error(path, "is longer than the " + std::to_string(sizeof address.sun_path - 1) +
                               " bytes that a socket's path may have");
  std::memcpy(address.sun_path, text.data(), text.size());
  return address;
}

OwnedFd stream_socket() {
  OwnedFd fd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!fd) throw std::runtime_error("socket: " + reason());
  return fd;
}

/// Throws unless only this user can write to the directory. A user who can write to it can replace the
/// socket.
void check_directory(const fs::path& directory) {
  if (::mkdir(directory.c_str(), geteuid() == 0 ? 0755 : 0700) != 0 && errno != EEXIST)
    throw path_error(directory, "cannot be created: " + reason() +
                                    "; create it for the user that runs wrenchd, or name another "
                                    "path with --control");
  struct stat status {};
  if (::stat(directory.c_str(), &status) != 0) throw path_error(directory, reason());
  if (!S_ISDIR(status.st_mode))
    throw path_error(directory, "is not a directory; name another path with --control");
  if (status.st_uid != geteuid() && status.st_uid != 0)
    throw path_error(directory, "belongs to uid " + std::to_string(status.st_uid) +
                                    ", who could replace the socket; name a path in a directory of your own");
  if ((status.st_mode & 022U) != 0 && (status.st_mode & S_ISVTX) == 0)
    throw path_error(directory, "other users can write there and replace the socket; run: chmod go-w " +
                                    directory.string());
}

}  // namespace

SocketPath choose_socket_path(const std::string& command_line, const ControlSettings& settings) {
  const std::pair<const char*, std::string> named[] = {{"--control", command_line},
                                                       {"WRENCHD_SOCKET", environment("WRENCHD_SOCKET")},
                                                       {"control.socket", settings.socket}};
  for (const auto& [where, path] : named) {
    if (path.empty()) continue;
    if (path == kNoSocket) return {};
    if (path.front() != '/')
      throw std::runtime_error(std::string(where) + ": expected an absolute path, or \"" + kNoSocket +
                               "\", found \"" + path + "\"");
    return {path, true};
  }
  // A list separated by colons; the first directory belongs to this unit.
  if (std::string run = environment("RUNTIME_DIRECTORY"); !run.empty())
    return {fs::path(run.substr(0, run.find(':'))) / kFile, true};
  if (const std::string run = environment("XDG_RUNTIME_DIR"); !run.empty() && geteuid() != 0)
    return {fs::path(run) / "wrenchd" / kFile, false};
  return {fs::path("/run/wrenchd") / kFile, false};
}

ListeningSocket::ListeningSocket(const fs::path& path, const RoleRules& rules, bool adopt) : path_(path) {
  if (adopt && adopt_from_systemd()) return;
  check_directory(path_.parent_path());
  lock_path();
  remove_stale_socket();
  bind_private();
  try {
    grant_access(rules);
    if (::listen(socket_.get(), kBacklog) != 0) throw path_error(path_, "cannot listen: " + reason());
  } catch (...) {
    ::unlink(path_.c_str());
    throw;
  }
}

ListeningSocket::~ListeningSocket() {
  struct stat status {};
  const bool ours = !from_systemd_ && ::lstat(path_.c_str(), &status) == 0 && status.st_dev == device_ &&
                    status.st_ino == inode_;
  if (ours) ::unlink(path_.c_str());
}

bool ListeningSocket::adopt_from_systemd() {
  const int passed = sd_listen_fds(1);
  if (passed <= 0) return false;
  const int fd = SD_LISTEN_FDS_START;
  if (passed != 1 || sd_is_socket_unix(fd, SOCK_STREAM, 1, nullptr, 0) <= 0)
    throw std::runtime_error(
        "systemd passes " + std::to_string(passed) +
        " file descriptors, and wanted is one Unix stream socket that listens: ListenStream= with a path");
  ::fcntl(fd, F_SETFD, FD_CLOEXEC);
  ::fcntl(fd, F_SETFL, O_NONBLOCK);
  socket_ = OwnedFd(fd);
  from_systemd_ = true;
  return true;
}

/// Locks the path while this object lives; the kernel unlocks it when the process ends. The lock file stays:
/// another daemon may be waiting to lock it.
void ListeningSocket::lock_path() {
  const fs::path file = path_.string() + ".lock";
  lock_ = OwnedFd(::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (!lock_) throw path_error(file, "cannot be created: " + reason());
  if (::flock(lock_.get(), LOCK_EX | LOCK_NB) != 0)
    throw path_error(path_, "another wrenchd listens there; stop it, or name another path with --control");
}

/// Removes the socket of a dead daemon. Throws if another program listens there. Precondition: the path is
/// locked.
void ListeningSocket::remove_stale_socket() {
  struct stat status {};
  if (::lstat(path_.c_str(), &status) != 0) return;
  if (!S_ISSOCK(status.st_mode))
    throw path_error(path_, "exists and is not a socket; move it away, or name another path with --control");
  const sockaddr_un address = address_of(path_);
  const OwnedFd probe = stream_socket();
  const bool lives =
      ::connect(probe.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 ||
      errno == EAGAIN;  // its backlog is full
  if (lives) throw path_error(path_, "another program listens there; name another path with --control");
  if (::unlink(path_.c_str()) != 0) throw path_error(path_, "cannot be removed: " + reason());
}

/// Creates the socket file with mode 0600, so that no other user can connect before grant_access().
void ListeningSocket::bind_private() {
  const sockaddr_un address = address_of(path_);
  socket_ = stream_socket();
  if (::fchmod(socket_.get(), 0600) != 0) throw path_error(path_, reason());
  if (::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    throw path_error(path_, "cannot be created: " + reason());
  struct stat status {};
  if (::lstat(path_.c_str(), &status) != 0) throw path_error(path_, reason());
  device_ = status.st_dev;
  inode_ = status.st_ino;
}

/// Changes group and mode of the socket file. Only this user can write to the directory, so the path still
/// names the file of bind_private().
void ListeningSocket::grant_access(const RoleRules& rules) {
  // If every user may connect, no group needs to own the file.
  const auto group = rules.anyone_may_observe ? std::nullopt
                     : rules.observers        ? rules.observers
                     : rules.operators        ? rules.operators
                                              : rules.administrators;
  if (group && ::chown(path_.c_str(), static_cast<uid_t>(-1), *group) != 0)
    throw path_error(path_, "cannot be given to group " + std::to_string(*group) + ": " + reason() +
                                "; add the user that runs wrenchd to that group");
  const mode_t mode = rules.anyone_may_observe ? 0666 : group ? 0660 : 0600;
  if (::chmod(path_.c_str(), mode) != 0) throw path_error(path_, reason());
}

}  // namespace wrenchd
