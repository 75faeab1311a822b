// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "daemon/control/owned_fd.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tools/view/connection_owner.hpp"

namespace wrenchd::test_connection_owner {

namespace {

using namespace test;

constexpr const char* kHead =
    "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode\n";

TEST_CASE("the owner of the other end of a connection of this process is its user", "[connection_owner]") {
  const OwnedFd listening(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in own{};
  own.sin_family = AF_INET;
  own.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  REQUIRE(::bind(listening.get(), reinterpret_cast<const sockaddr*>(&own), sizeof own) == 0);
  REQUIRE(::listen(listening.get(), 1) == 0);
  socklen_t size = sizeof own;
  REQUIRE(::getsockname(listening.get(), reinterpret_cast<sockaddr*>(&own), &size) == 0);
  const OwnedFd client(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  REQUIRE(::connect(client.get(), reinterpret_cast<const sockaddr*>(&own), sizeof own) == 0);
  sockaddr_in peer{};
  REQUIRE(::getsockname(client.get(), reinterpret_cast<sockaddr*>(&peer), &size) == 0);
  const auto owner = connection_owner(ntohs(peer.sin_port), ntohs(own.sin_port));
  REQUIRE(owner);
  CHECK(*owner == ::geteuid());
  CHECK_FALSE(connection_owner(ntohs(peer.sin_port), static_cast<std::uint16_t>(ntohs(own.sin_port) + 1)));
}

TEST_CASE("the lists of IPv4 and IPv6 connections are read, and only loopback and open ones count",
          "[connection_owner]") {
  const TemporaryDirectory net;
  // Two appended texts: gcc 12 reports false out-of-bounds strings in a sum.
  std::string four = kHead, six = kHead;
  four +=
      // This end of the connection belongs to user 0, the other end to user 1000.
      "   0: 0100007F:1F90 0100007F:C000 01 00000000:00000000 00:00000000 00000000     0        0 1\n"
      "   1: 0100007F:C000 0100007F:1F90 01 00000000:00000000 00:00000000 00000000  1000        0 2\n"
      // Time-wait and another machine.
      "   2: 0100007F:C001 0100007F:1F90 06 00000000:00000000 00:00000000 00000000     0        0 3\n"
      "   3: 0100000A:C002 0100007F:1F90 01 00000000:00000000 00:00000000 00000000  1001        0 4\n"
      "   4: nonsense\n";
  six +=
      "   0: 0000000000000000FFFF00000100007F:C003 0000000000000000FFFF00000100007F:1F90 01 "
      "00000000:00000000 00:00000000 00000000  1002        0 5\n"
      "   1: 00000000000000000000000001000000:C004 00000000000000000000000001000000:1F90 01 "
      "00000000:00000000 00:00000000 00000000  1003        0 6\n";
  net.write("tcp", four);
  net.write("tcp6", six);
  const auto owner = [&](std::uint16_t peer) { return connection_owner(peer, 0x1f90, net.path()); };
  CHECK(owner(0xc000) == uid_t{1000});
  CHECK_FALSE(owner(0xc001));
  CHECK_FALSE(owner(0xc002));
  CHECK(owner(0xc003) == uid_t{1002});
  CHECK(owner(0xc004) == uid_t{1003});
  CHECK_FALSE(owner(0xc005));
  CHECK_FALSE(connection_owner(1, 2, net.path() / "none"));
}

}  // namespace
}  // namespace wrenchd::test_connection_owner
