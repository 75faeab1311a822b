// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include <sys/types.h>

namespace wrenchd {

/// Returns the user whose process holds the other end of a TCP connection on this machine; nothing if the
/// kernel does not list it. The kernel has no SO_PEERCRED for TCP, but lists the owner of every socket in
/// /proc/net/tcp and /proc/net/tcp6. peer_port: port of the other end; own_port: port of this end; both ends
/// are at loopback addresses. proc_net: directory of the lists. Not RT-safe: reads files.
std::optional<uid_t> connection_owner(std::uint16_t peer_port, std::uint16_t own_port,
                                      const std::filesystem::path& proc_net = "/proc/net");

}  // namespace wrenchd
