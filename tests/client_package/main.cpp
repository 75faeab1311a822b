// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdio>

#include <wrenchd/client.hpp>

/// Without a daemon, a client that links and runs reports that the socket is missing.
int main() {
  try {
    wrenchd::Client client("/nowhere/control.sock");
    client.open_state();
  } catch (const wrenchd::ClientError& error) {
    std::puts(error.what());
    return error.code() == wrenchd::ClientError::kNoDaemon ? 0 : 1;
  }
  return 1;
}
