// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/connection_owner.hpp"

#include <array>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <string>

namespace wrenchd {
namespace {

constexpr const char* kEstablished = "01";

/// "0100007F:1F51", as the kernel prints an end. The address is printed as a number of this machine.
std::string text_of(const TcpEnd& end) {
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), "%08X:%04X", end.address, static_cast<unsigned>(end.port));
  return text.data();
}

/// True if a column of the table is this end, written as an IPv4 address or as one that is mapped into IPv6.
bool is_end(const std::string& column, const std::string& end) {
  static const std::string mapped = "0000000000000000FFFF0000";
  return column == end || column == mapped + end;
}

}  // namespace

std::optional<uid_t> owner_in(std::istream& table, const TcpEnd& local, const TcpEnd& remote) {
  const std::string local_text = text_of(local), remote_text = text_of(remote);
  std::string line;
  std::getline(table, line);  // the heading
  while (std::getline(table, line)) {
    std::istringstream row(line);
    std::string number, at, to, state, queues, timer, retransmits;
    std::uint64_t uid = 0, timeout = 0, inode = 0;
    row >> number >> at >> to >> state >> queues >> timer >> retransmits >> uid >> timeout >> inode;
    if (!row || !is_end(at, local_text) || !is_end(to, remote_text)) continue;
    if (state != kEstablished || inode == 0) return {};
    return static_cast<uid_t>(uid);
  }
  return {};
}

std::optional<uid_t> connection_owner(const TcpEnd& peer, const TcpEnd& own) {
  for (const char* name : {"/proc/net/tcp", "/proc/net/tcp6"}) {
    std::ifstream table(name);
    if (const auto uid = owner_in(table, peer, own)) return uid;
  }
  return {};
}

}  // namespace wrenchd
