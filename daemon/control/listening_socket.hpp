// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <sys/types.h>

#include "config/settings.hpp"
#include "daemon/control/owned_fd.hpp"
#include "daemon/control/role.hpp"

namespace wrenchd {

/// Path of the control socket.
struct SocketPath {
  std::filesystem::path path;     ///< empty: no socket
  bool explicitly_named = false;  ///< false: the default path, which another daemon may use
};

/// Returns the first path given by: command line, $WRENCHD_SOCKET, configuration, default path. Throws
/// std::runtime_error if the path is not absolute. Not RT-safe: allocates.
SocketPath choose_socket_path(const std::string& command_line, const ControlSettings& settings);

/// A listening Unix stream socket. Not RT-safe: system calls.
///
/// Only the owner can connect until the final permissions are set. The constructor replaces the socket of a
/// daemon that has died, and throws if another daemon listens at the path. It creates the directory if the
/// parent exists. The directory must belong to the owner, and no other user may write to it. A socket that
/// systemd passes (LISTEN_FDS) is used unchanged.
class ListeningSocket {
 public:
  /// adopt: uses a socket that systemd passes. Of two sockets of one process only the first does. Throws
  /// std::runtime_error; the message names path and cure.
  ListeningSocket(const std::filesystem::path& path, const RoleRules& rules, bool adopt = true);
  /// Removes the socket file, if the constructor created it.
  ~ListeningSocket();
  ListeningSocket(const ListeningSocket&) = delete;
  ListeningSocket& operator=(const ListeningSocket&) = delete;

  int fd() const noexcept { return socket_.get(); }
  const std::filesystem::path& path() const noexcept { return path_; }

 private:
  bool adopt_from_systemd();
  void lock_path();
  void remove_stale_socket();
  void bind_private();
  void grant_access(const RoleRules& rules);

  std::filesystem::path path_;
  OwnedFd lock_;
  OwnedFd socket_;
  bool from_systemd_ = false;
  dev_t device_ = 0;  ///< device of the socket file: the destructor removes no other file
  ino_t inode_ = 0;   ///< inode of the socket file
};

}  // namespace wrenchd
