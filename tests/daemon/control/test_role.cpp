// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>

#include <catch2/catch.hpp>
#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "daemon/control/listening_socket.hpp"
#include "daemon/control/role.hpp"

namespace wrenchd::test_role {

namespace {

constexpr gid_t kObservers = 101, kOperators = 102, kAdministrators = 103, kOthers = 65534;

TEST_CASE("the highest of a user's primary and supplementary groups determines the role", "[role]") {
  const RoleRules rules{999, false, kObservers, kOperators, kAdministrators};
  struct {
    Peer peer;
    std::optional<Role> role;
  } const table[] = {
      {{1000, kOthers, {}}, std::nullopt},
      {{1000, kOthers, {7, 8}}, std::nullopt},
      {{1000, kObservers, {}}, Role::observer},
      {{1000, kOthers, {8, kObservers}}, Role::observer},
      {{1000, kOthers, {kOperators}}, Role::operator_},
      {{1000, kOperators, {kObservers}}, Role::operator_},
      {{1000, kOthers, {kAdministrators, kObservers}}, Role::administrator},
      {{0, kOthers, {}}, Role::administrator},
      {{999, kOthers, {}}, Role::administrator},
      {{101, kOthers, {}}, std::nullopt},  // a uid is no gid
      {{103, kOthers, {}}, std::nullopt},
  };
  for (const auto& [peer, role] : table) {
    INFO(peer.uid << ' ' << peer.gid);
    CHECK((role_of(peer, rules) == role));
  }
}

TEST_CASE("if no group is set, only root and the daemon's own user have a role", "[role]") {
  const RoleRules no_groups{999, false, {}, {}, {}};
  CHECK_FALSE(role_of({1000, kObservers, {kOperators, kAdministrators, 0}}, no_groups));
  CHECK((role_of({999, kOthers, {}}, no_groups) == Role::administrator));
  const RoleRules anyone_observes{999, true, {}, kOperators, {}};
  CHECK((role_of({1000, kOthers, {}}, anyone_observes) == Role::observer));
  CHECK((role_of({1000, kOthers, {kOperators}}, anyone_observes) == Role::operator_));
}

TEST_CASE("groups are looked up by name, and an unknown group is rejected with the remedy", "[role]") {
  ControlSettings settings;
  settings.observers = "*";
  settings.operators = "daemon";
  const RoleRules rules = load_role_rules(settings, "wrenchd.toml");
  CHECK(rules.anyone_may_observe);
  CHECK_FALSE(rules.observers);
  CHECK(rules.operators == gid_t{1});
  CHECK_FALSE(rules.administrators);
  CHECK(rules.own_uid == geteuid());
  settings.administrators = "no-such-group-here";
  CHECK_THROWS_WITH(
      load_role_rules(settings, "wrenchd.toml"),
      "wrenchd.toml: key 'control.administrators': this machine has no group 'no-such-group-here'; "
      "create it with: groupadd --system no-such-group-here");
}

TEST_CASE("the kernel identifies the peer of a connection", "[role]") {
  std::array<int, 2> ends{};
  REQUIRE(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) == 0);
  const OwnedFd a(ends[0]), b(ends[1]);
  const std::optional<Peer> peer = peer_of(a.get());
  REQUIRE(peer);
  CHECK(peer->uid == geteuid());
  CHECK(peer->gid == getegid());
  CHECK(peer->pid == getpid());
  std::vector<gid_t> own(static_cast<std::size_t>(getgroups(0, nullptr)));
  REQUIRE(getgroups(static_cast<int>(own.size()), own.data()) >= 0);
  CHECK(peer->groups == own);
  CHECK_FALSE(peer_of(-1));
  std::array<int, 2> pipe_ends{};
  REQUIRE(pipe2(pipe_ends.data(), O_CLOEXEC) == 0);
  const OwnedFd read_end(pipe_ends[0]), write_end(pipe_ends[1]);
  CHECK_FALSE(peer_of(read_end.get()));
}

}  // namespace
}  // namespace wrenchd::test_role
