// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace wrenchd {

/// Options of `wrenchctl view`.
struct ViewOptions {
  std::filesystem::path recording;  ///< recording to show; empty: the running daemon
  std::filesystem::path compared;   ///< second recording beside the first one; empty: none
  std::string socket;               ///< path of the daemon's socket; empty: default paths
  std::uint16_t port = 0;           ///< 0: a free port
  bool open_browser = false;        ///< opens the page in a browser with xdg-open
};

/// Prints the address of the page and serves the page until a signal arrives. Throws std::runtime_error if
/// the start fails. Not RT-safe: runs a server.
void run_view(const ViewOptions& options);

}  // namespace wrenchd
