// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <istream>
#include <optional>

#include <sys/types.h>

namespace wrenchd {

/// One end of a TCP connection over IPv4.
struct TcpEnd {
  std::uint32_t address = 0;  ///< in network byte order, as in sockaddr_in
  std::uint16_t port = 0;     ///< in host byte order
};

/// Returns the user of the socket with this local end and this remote end, from a table as in /proc/net/tcp
/// or /proc/net/tcp6. Returns nothing unless the connection is established and a process holds the socket: a
/// closed socket counts as root's in the table. Not RT-safe: reads a file.
std::optional<uid_t> owner_in(std::istream& table, const TcpEnd& local, const TcpEnd& remote);

/// Returns the user at the other end of a connection of this machine: of the socket with the local end `peer`
/// and the remote end `own`. Not RT-safe: reads files.
std::optional<uid_t> connection_owner(const TcpEnd& peer, const TcpEnd& own);

}  // namespace wrenchd
