// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdio>

#include <wrenchd/client.hpp>

/// No daemon is there: a client that links and runs says so.
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
