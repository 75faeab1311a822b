// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/end_signals.hpp"

#include <atomic>
#include <csignal>

namespace wrenchd {
namespace {

std::atomic<bool> signalled{false};

}  // namespace

void catch_end_signals() {
  struct sigaction action {};
  action.sa_handler = [](int) { signalled.store(true); };
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGQUIT}) sigaction(signal, &action, nullptr);
}

bool end_requested() noexcept {
  return signalled.load();
}

}  // namespace wrenchd
