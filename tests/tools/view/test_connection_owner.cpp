// SPDX-License-Identifier: GPL-3.0-or-later
#include <sstream>
#include <string>

#include <arpa/inet.h>
#include <catch2/catch.hpp>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "files/owned_fd.hpp"
#include "tools/view/connection_owner.hpp"

namespace wrenchd {
namespace {

TcpEnd loopback(std::uint16_t port) {
  return {htonl(INADDR_LOOPBACK), port};
}

constexpr const char* kHeading =
    "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode\n";

std::string row(const std::string& local, const std::string& remote, const std::string& state, int uid,
                int inode) {
  return "   0: " + local + " " + remote + " " + state + " 00000000:00000000 00:00000000 00000000  " +
         std::to_string(uid) + "        0 " + std::to_string(inode) + " 1 0000000000000000 20 4 30 10 -1\n";
}

std::optional<uid_t> owner(const std::string& rows) {
  std::istringstream table(kHeading + rows);
  return owner_in(table, loopback(0x9c40), loopback(0x1f51));
}

TEST_CASE("the user of a connection is that of its row with both ends", "[view]") {
  if (htonl(1) == 1) return;  // the rows below are those of a little-endian machine
  const std::string peer = "0100007F:9C40", own = "0100007F:1F51";
  CHECK(owner(row(peer, own, "01", 1001, 77)) == uid_t{1001});
  // The server's own end of the same connection, and a connection from another port, come first.
  CHECK(owner(row(own, peer, "01", 1000, 76) + row("0100007F:9C41", own, "01", 1002, 75) +
              row(peer, own, "01", 1001, 77)) == uid_t{1001});
  const std::string mapped = "0000000000000000FFFF0000";
  CHECK(owner(row(mapped + peer, mapped + own, "01", 1001, 77)) == uid_t{1001});
  CHECK_FALSE(owner("").has_value());
  CHECK_FALSE(owner("garbage\n").has_value());
}

TEST_CASE("a socket that its process has closed has no owner, although the table says root", "[view]") {
  const std::string peer = "0100007F:9C40", own = "0100007F:1F51";
  CHECK_FALSE(owner(row(peer, own, "01", 0, 0)).has_value());  // no inode
  CHECK_FALSE(owner(row(peer, own, "05", 0, 0)).has_value());  // FIN_WAIT2
  CHECK_FALSE(owner(row(peer, own, "06", 0, 0)).has_value());  // TIME_WAIT
  CHECK_FALSE(owner(row(peer, own, "08", 1001, 77)).has_value());
}

TEST_CASE("the kernel's table names this user for a connection of this process", "[view]") {
  const OwnedFd listening(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof at;
  REQUIRE(::bind(listening.get(), reinterpret_cast<sockaddr*>(&at), length) == 0);
  REQUIRE(::listen(listening.get(), 4) == 0);
  REQUIRE(::getsockname(listening.get(), reinterpret_cast<sockaddr*>(&at), &length) == 0);
  OwnedFd client(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  REQUIRE(::connect(client.get(), reinterpret_cast<sockaddr*>(&at), sizeof at) == 0);
  const OwnedFd accepted(::accept(listening.get(), nullptr, nullptr));
  sockaddr_in peer{};
  length = sizeof peer;
  REQUIRE(::getpeername(accepted.get(), reinterpret_cast<sockaddr*>(&peer), &length) == 0);
  const TcpEnd peer_end{peer.sin_addr.s_addr, ntohs(peer.sin_port)},
      own_end{at.sin_addr.s_addr, ntohs(at.sin_port)};
  CHECK(connection_owner(peer_end, own_end) == geteuid());
  client.reset();
  CHECK_FALSE(connection_owner(peer_end, own_end).has_value());
}

}  // namespace
}  // namespace wrenchd
