// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/connection_owner.hpp"

#include <charconv>
#include <sstream>
#include <string>
#include <string_view>

#include "core/files/opened_file.hpp"

namespace wrenchd {
namespace {

/// An address of /proc/net/tcp: hexadecimal address, colon, hexadecimal port.
struct Endpoint {
  std::string_view address;
  unsigned port = 0;
};

std::optional<Endpoint> endpoint(std::string_view text) {
  const std::size_t colon = text.find(':');
  if (colon == text.npos) return {};
  Endpoint end{text.substr(0, colon), 0};
  const std::string_view port = text.substr(colon + 1);
  const auto [stop, error] = std::from_chars(port.data(), port.data() + port.size(), end.port, 16);
  if (error != std::errc{} || stop != port.data() + port.size()) return {};
  return end;
}

/// The kernel prints each 32-bit word of an address in the byte order of the machine: 127.0.0.1 is 0100007F.
bool is_loopback(std::string_view address) {
  constexpr std::string_view kMapped = "0000000000000000FFFF0000";  // ::ffff:a.b.c.d
  if (address == "00000000000000000000000001000000") return true;   // ::1
  if (address.size() == 32 && address.starts_with(kMapped)) address.remove_prefix(kMapped.size());
  return address.size() == 8 && address.ends_with("7F");
}

/// Returns the owner of the socket whose own end is peer_port and whose remote end is own_port.
std::optional<uid_t> owner_in(const std::string& list, std::uint16_t peer_port, std::uint16_t own_port) {
  std::istringstream lines(list);
  std::string line;
  std::getline(lines, line);  // the names of the columns
  while (std::getline(lines, line)) {
    std::istringstream words(line);
    std::string slot, local, remote, state, queues, timer, retransmits;
    uid_t uid = 0;
    if (!(words >> slot >> local >> remote >> state >> queues >> timer >> retransmits >> uid)) continue;
    const auto here = endpoint(local), there = endpoint(remote);
    // A socket that its process has closed has no owner any more: the kernel lists it with user 0.
    constexpr std::string_view kEstablished = "01", kCloseWait = "08";
    if (state != kEstablished && state != kCloseWait) continue;
    if (here && there && here->port == peer_port && there->port == own_port && is_loopback(here->address) &&
        is_loopback(there->address))
      return uid;
  }
  return {};
}

}  // namespace

std::optional<uid_t> connection_owner(std::uint16_t peer_port, std::uint16_t own_port,
                                      const std::filesystem::path& proc_net) {
  for (const char* const name : {"tcp", "tcp6"})
    if (const auto list = read_file_if_readable(proc_net / name))
      if (const auto uid = owner_in(*list, peer_port, own_port)) return uid;
  return {};
}

}  // namespace wrenchd
