// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>

#include "daemon/control/control_methods.hpp"
#include "daemon/control/control_socket.hpp"
#include "daemon/control/daemon_methods.hpp"
#include "daemon/control/event_feed.hpp"
#include "daemon/control/lease.hpp"
#include "daemon/control/listening_socket.hpp"

namespace wrenchd {

class Runtime;

/// The control socket of a running station, and what is behind it: the methods, the lease, the events. Parts
/// of the daemon add their methods, then it opens.
class ControlInterface {
 public:
  /// Station and feed must outlive this.
  ControlInterface(Runtime& station, EventFeed& feed);

  /// To add rows to, before open().
  MethodTable& methods() noexcept { return methods_; }
  /// Likewise, of what `status` answers.
  StatusSections& status_sections() noexcept { return status_sections_; }

  /// Serves from now on. Throws std::runtime_error, which names the path, or the setting of a group that does
  /// not exist, and the cure.
  void open(const std::filesystem::path& path, const IdentifyPeer& identify = peer_of);

 private:
  Runtime& runtime_;
  EventFeed& feed_;
  Lease lease_;
  StatusSections status_sections_;
  MethodTable methods_;
  std::optional<ListeningSocket> listening_socket_;
  std::optional<ControlSocket> control_socket_;  ///< last: its thread uses all of the above
};

}  // namespace wrenchd
