// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <sys/types.h>

#include "config/settings.hpp"

namespace wrenchd {

/// What somebody at the control socket may do; each may do what those before it may.
enum class Role : std::uint8_t {
  observer,       ///< sees everything, and may stop
  operator_,      ///< takes the lease, arms, disarms, acknowledges
  administrator,  ///< reconfigures, and takes the lease from another
};

/// "operator"
const char* name(Role role) noexcept;

/// Who is at the other end of a socket, as the kernel says: as of the moment at which it connected. The
/// number of its process is for people; nothing is decided by it, for numbers are given again.
struct Peer {
  uid_t uid = 0;
  gid_t gid = 0;
  std::vector<gid_t> groups;  ///< supplementary
  pid_t pid = 0;

  /// "process 4242 of uid 1000"
  std::string description() const;
};

/// Of a connected Unix socket. Nothing where the kernel does not say.
std::optional<Peer> peer_of(int socket);

/// Which groups may do what. root and the daemon's own user may do everything.
struct RoleRules {
  uid_t own_uid = 0;
  bool anyone_may_observe = false;
  std::optional<gid_t> observers, operators, administrators;
};

/// Looks the groups up. Throws std::runtime_error, which names the setting and the cure, where there is no
/// such group. May ask the network, as name services do: not from a thread that others wait for.
RoleRules load_role_rules(const ControlSettings& settings, const std::string& file);

/// The highest role of that peer; nothing: it may not even look.
std::optional<Role> role_of(const Peer& peer, const RoleRules& rules) noexcept;

/// The group whose members have a role, as settings name it, for messages: "group 'wrenchd-operators'", or
/// what to set where none does.
std::string role_group_text(Role role, const ControlSettings& settings);

}  // namespace wrenchd
