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

/// Where the control socket is to be.
struct SocketPath {
  std::filesystem::path path;     ///< empty: nowhere, nobody wants one
  bool explicitly_named = false;  ///< somebody named it; else it is the usual place, and may be another's
};

/// The first of: the command line's, $WRENCHD_SOCKET, the configuration's, and the usual place. Throws
/// std::runtime_error where the path is not absolute.
SocketPath choose_socket_path(const std::string& command_line, const ControlSettings& settings);

/// A Unix stream socket that listens where it was told to, and nowhere else.
///
/// Nobody but the owner can connect before the permissions are those that were asked for. A socket that a
/// dead daemon left is replaced; beside a living one none is made. The directory is made where its parent is
/// there; it has to be the owner's, and writable by nobody else. What systemd passes (LISTEN_FDS) is taken as
/// it is.
class ListeningSocket {
 public:
  /// Throws std::runtime_error, which names path and cure.
  ListeningSocket(const std::filesystem::path& path, const RoleRules& rules);
  /// Removes what it made.
  ~ListeningSocket();
  ListeningSocket(const ListeningSocket&) = delete;
  ListeningSocket& operator=(const ListeningSocket&) = delete;

  int fd() const noexcept { return socket_.get(); }
  const std::filesystem::path& path() const noexcept { return path_; }
  bool from_systemd() const noexcept { return from_systemd_; }

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
  dev_t device_ = 0;  ///< of the socket's file, to remove no other
  ino_t inode_ = 0;
};

}  // namespace wrenchd
