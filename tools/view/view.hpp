// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace wrenchd {

/// wrenchctl view
struct ViewOptions {
  std::filesystem::path recording;  ///< empty: the daemon that runs
  std::string socket;               ///< of that; empty: the usual places
  std::uint16_t port = 0;           ///< 0: one that is free
  bool open_browser = false;        ///< in a browser, by xdg-open
};

/// Prints the address of the page, and serves it until a signal ends it. Throws what goes wrong at the start.
void run_view(const ViewOptions& options);

}  // namespace wrenchd
