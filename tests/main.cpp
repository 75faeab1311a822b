// SPDX-License-Identifier: GPL-3.0-or-later
#define CATCH_CONFIG_RUNNER
#include <cstdio>
#include <cstdlib>

#include <catch2/catch.hpp>
#include <spdlog/spdlog.h>

#include "tests/support/paths.hpp"
#include "tests/support/rate_check.hpp"
#include "tests/support/temporary_directory.hpp"

namespace {

/// Prints the text of a requested skip when the test case ends, because Catch2 2.13 has no skip. ctest then
/// reports the test as skipped (SKIP_REGULAR_EXPRESSION). If a check of the test case failed, prints nothing.
class SkipReporter : public Catch::TestEventListenerBase {
 public:
  using TestEventListenerBase::TestEventListenerBase;

  void testCaseStarting(const Catch::TestCaseInfo&) override { wrenchd::test::skip_text().clear(); }
  void testCaseEnded(const Catch::TestCaseStats& stats) override {
    if (!wrenchd::test::skip_text().empty() && stats.totals.assertions.failed == 0)
      std::printf("%s\n", wrenchd::test::skip_text().c_str());
  }
};
CATCH_REGISTER_LISTENER(SkipReporter)

}  // namespace

/// Daemons in tests have no socket unless the test gives them one, because the default path is for one daemon
/// and may belong to the machine's own. Flight recordings go to a directory that is removed after the tests.
/// The mesh cache belongs to the build directory, so that no test passes because of another build's cache;
/// WRENCHD_TEST_CACHE names another directory. The log is discarded.
int main(int argc, char** argv) {
  setenv("WRENCHD_SOCKET", "none", 1);
  const wrenchd::test::TemporaryDirectory state;
  setenv("XDG_STATE_HOME", state.path().c_str(), 1);
  const char* const cache = std::getenv("WRENCHD_TEST_CACHE");
  setenv("XDG_CACHE_HOME", cache ? cache : wrenchd::test::program_path("../tests/cache").c_str(), 1);
  spdlog::default_logger()->set_level(spdlog::level::off);
  return Catch::Session().run(argc, argv);
}

#ifdef __SANITIZE_ADDRESS__
/// libhdf5 1.10 leaks memory of its own when it rejects some damaged files. Leaks of wrenchd are still
/// reported.
extern "C" const char* __lsan_default_suppressions();
extern "C" const char* __lsan_default_suppressions() {
  return "leak:libhdf5";
}
#endif
