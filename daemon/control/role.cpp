// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/role.hpp"

#include <algorithm>
#include <cerrno>
#include <stdexcept>

#include <grp.h>
#include <sys/socket.h>
#include <unistd.h>

namespace wrenchd {
namespace {

/// NGROUPS_MAX of Linux.
constexpr std::size_t kMostGroups = 65536;

std::optional<gid_t> group_of(const char* key, const std::string& group, const std::string& file) {
  if (group.empty()) return {};
  // getgrnam_r() needs a buffer of unknown size. No other thread calls getgrnam() while the daemon starts.
  if (const struct group* found = getgrnam(group.c_str())) return found->gr_gid;
  throw std::runtime_error(file + ": key 'control." + key + "': this machine has no group '" + group +
                           "'; create it with: groupadd --system " + group);
}

bool is_member(const Peer& peer, const std::optional<gid_t>& group) noexcept {
  if (!group) return false;
  return peer.gid == *group || std::find(peer.groups.begin(), peer.groups.end(), *group) != peer.groups.end();
}

}  // namespace

const char* name(Role role) noexcept {
  switch (role) {
    case Role::observer:
      return "observer";
    case Role::operator_:
      return "operator";
    case Role::administrator:
      return "administrator";
  }
  return "unknown";
}

std::string Peer::description() const {
  return "process " + std::to_string(pid) + " of uid " + std::to_string(uid);
}

std::optional<Peer> peer_of(int socket) {
  ucred credentials{};
  socklen_t length = sizeof credentials;
  if (getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &credentials, &length) != 0 ||
      length != sizeof credentials || credentials.pid == 0)
    return {};
  Peer peer{credentials.uid, credentials.gid, {}, credentials.pid};
  for (std::size_t room = 32; room <= kMostGroups; room *= 2) {
    peer.groups.resize(room);
    length = static_cast<socklen_t>(room * sizeof(gid_t));
    if (getsockopt(socket, SOL_SOCKET, SO_PEERGROUPS, peer.groups.data(), &length) == 0) {
      peer.groups.resize(length / sizeof(gid_t));
      return peer;
    }
    if (errno != ERANGE) break;
  }
  return {};
}

RoleRules load_role_rules(const ControlSettings& settings, const std::string& file) {
  RoleRules rules;
  rules.own_uid = geteuid();
  rules.anyone_may_observe = settings.observers == kEverybody;
  if (!rules.anyone_may_observe) rules.observers = group_of("observers", settings.observers, file);
  rules.operators = group_of("operators", settings.operators, file);
  rules.administrators = group_of("administrators", settings.administrators, file);
  return rules;
}

std::optional<Role> role_of(const Peer& peer, const RoleRules& rules) noexcept {
  if (peer.uid == 0 || peer.uid == rules.own_uid || is_member(peer, rules.administrators))
    return Role::administrator;
  if (is_member(peer, rules.operators)) return Role::operator_;
  if (rules.anyone_may_observe || is_member(peer, rules.observers)) return Role::observer;
  return {};
}

std::string role_group_text(Role role, const ControlSettings& settings) {
  const std::string& group = role == Role::administrator ? settings.administrators
                             : role == Role::operator_   ? settings.operators
                                                         : settings.observers;
  const std::string key = std::string(name(role)) + "s";
  if (group.empty()) return "root; set '" + key + "' under [control] to a group to permit other users";
  if (group == kEverybody) return "everybody";
  return "members of group '" + group + "'; after adding a user to it, log in again";
}

}  // namespace wrenchd
