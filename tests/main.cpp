// SPDX-License-Identifier: GPL-3.0-or-later
#define CATCH_CONFIG_RUNNER
#include <cstdlib>

#include <catch2/catch.hpp>
#include <spdlog/spdlog.h>

#include "tests/support/temporary_directory.hpp"

/// Daemons that tests start beside each other have no socket unless a test gives them one: the usual place is
/// for one daemon, and may be that of the machine's own. What their flight recorders write is gone with the
/// tests. The meshes they keep are the build's own, not the user's: no test passes for what another build
/// left behind. WRENCHD_TEST_CACHE names another directory for them. What is logged here nobody reads.
int main(int argc, char** argv) {
  setenv("WRENCHD_SOCKET", "none", 1);
  const wrenchd::test::TemporaryDirectory state;
  setenv("XDG_STATE_HOME", state.path().c_str(), 1);
  const char* const cache = std::getenv("WRENCHD_TEST_CACHE");
  setenv("XDG_CACHE_HOME", cache ? cache : WRENCHD_BINARY_DIR "/../tests/cache", 1);
  spdlog::default_logger()->set_level(spdlog::level::off);
  return Catch::Session().run(argc, argv);
}
