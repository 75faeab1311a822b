// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <sys/types.h>

#include "config/settings.hpp"

namespace wrenchd {

/// Permissions of a client of the control socket. Each role includes the permissions of the roles before it.
enum class Role : std::uint8_t {
  observer,       ///< reads everything, and may stop
  operator_,      ///< acquires the lease, arms, disarms, acknowledges
  administrator,  ///< reconfigures, and preempts the lease
};

/// "operator"
const char* name(Role role) noexcept;

/// The process at the other end of a socket when it connected, from the kernel. The process id is for people
/// only: the kernel reuses ids, so no permission depends on it.
struct Peer {
  uid_t uid = 0;
  gid_t gid = 0;
  std::vector<gid_t> groups;  ///< supplementary
  pid_t pid = 0;

  /// "process 4242 of uid 1000"
  std::string description() const;
};

/// Returns the peer of a connected Unix socket; nothing if the kernel gives no credentials. Not RT-safe:
/// system calls.
std::optional<Peer> peer_of(int socket);

/// The group of each role. root and the user of the daemon are administrators.
struct RoleRules {
  uid_t own_uid = 0;
  bool anyone_may_observe = false;
  std::optional<gid_t> observers, operators, administrators;
};

/// Looks up the configured groups. Throws std::runtime_error if a group does not exist; the message names the
/// setting and the cure. Not RT-safe: a name service may query the network and take seconds.
RoleRules load_role_rules(const ControlSettings& settings, const std::string& file);

/// Returns the highest role of the peer; nothing: the peer may not connect.
std::optional<Role> role_of(const Peer& peer, const RoleRules& rules) noexcept;

/// Returns for messages which users have the role: "members of group 'wrenchd-operators'; ...", or the
/// setting to change if no group has it. Not RT-safe: allocates.
std::string role_group_text(Role role, const ControlSettings& settings);

}  // namespace wrenchd
