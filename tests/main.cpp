// SPDX-License-Identifier: GPL-3.0-or-later
#define CATCH_CONFIG_RUNNER
#include <cstdlib>

#include <catch2/catch.hpp>
#include <spdlog/spdlog.h>

#include "tests/support/rate_check.hpp"
#include "tests/support/temporary_directory.hpp"

using SkipReporter = wrenchd::test::SkipReporter;
CATCH_REGISTER_LISTENER(SkipReporter)

/// Daemons in tests have no socket unless the test gives them one, because the default path is for one daemon
/// and may belong to the machine's own. Flight recordings go to a directory that is removed after the tests.
/// The mesh cache belongs to the build directory, so that no test passes because of another build's cache.
/// The log is discarded.
int main(int argc, char** argv) {
  setenv("WRENCHD_SOCKET", "none", 1);
  const wrenchd::test::TemporaryDirectory state;
  setenv("XDG_STATE_HOME", state.path().c_str(), 1);
  setenv("XDG_CACHE_HOME", WRENCHD_BINARY_DIR "/../tests/cache", 1);
  spdlog::default_logger()->set_level(spdlog::level::off);
  return Catch::Session().run(argc, argv);
}
