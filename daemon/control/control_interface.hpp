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

/// The control interface of a runtime: control socket, method table and lease. Parts of the daemon add their
/// methods before open(). Not RT-safe: allocates.
class ControlInterface {
 public:
  /// The runtime and the feed must outlive this object.
  ControlInterface(Runtime& runtime, EventFeed& feed);

  /// Method table. Add rows before open().
  MethodTable& methods() noexcept { return methods_; }
  /// Additional members of the result of `status`. Add them before open().
  StatusSections& status_sections() noexcept { return status_sections_; }

  /// Starts to serve clients. Throws std::runtime_error if the path cannot be used or a configured group does
  /// not exist; the message names the path or the setting, and the cure.
  void open(const std::filesystem::path& path, const IdentifyPeer& identify = peer_of);

 private:
  Runtime& runtime_;
  EventFeed& feed_;
  Lease lease_;
  StatusSections status_sections_;
  MethodTable methods_;
  std::optional<ListeningSocket> listening_socket_;
  std::optional<ControlSocket> control_socket_;  ///< last member: its thread uses the members above
};

}  // namespace wrenchd
