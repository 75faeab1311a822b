// SPDX-License-Identifier: GPL-3.0-or-later
#define CATCH_CONFIG_RUNNER
#include <cstdlib>

#include <catch2/catch.hpp>
#include <spdlog/spdlog.h>

#include "tests/support/temporary_directory.hpp"

/// Daemons that tests start beside each other have no socket unless a test gives them one: the usual place is
/// for one daemon, and may be that of the machine's own. What their flight recorders write is gone with the
/// tests. What is logged here nobody reads.
int main(int argc, char** argv) {
  setenv("WRENCHD_SOCKET", "none", 1);
  const wrenchd::test::TemporaryDirectory state;
  setenv("XDG_STATE_HOME", state.path().c_str(), 1);
  spdlog::default_logger()->set_level(spdlog::level::off);
  return Catch::Session().run(argc, argv);
}
