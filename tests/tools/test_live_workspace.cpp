// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "tests/support/rate_check.hpp"
#include "tests/support/running_daemon.hpp"
#include "tools/live_workspace.hpp"

namespace wrenchd::test_live_workspace {

namespace {

using namespace test;
using Catch::Contains;

TEST_CASE("wrenchctl workspace shows and changes scale and clutch", "[live_workspace]") {
  const MachineLoad load;
  const RunningDaemon daemon;
  REQUIRE_RATE(load, daemon.program.wait_for_output("state: disarmed"));
  CHECK(daemon.ctl({"workspace"}).out == workspace_text({{"scale", 1.0}, {"clutched", false}}));

  CHECK(daemon.ctl({"workspace", "scale", "2"}).out ==
        "scale 1 -> scale 2\nundo: wrenchctl workspace scale 1\n");
  CHECK(daemon.ctl({"workspace", "clutch", "on"}).out ==
        "clutch off -> clutch on\nundo: wrenchctl workspace clutch off\n");
  CHECK(daemon.ask({"workspace"}) == Json({{"clutched", true}, {"scale", 2.0}}));
  CHECK(daemon.ctl({"workspace", "clutch", "on"}).out == "clutch on -> clutch on\n");
  CHECK(daemon.ctl({"workspace", "recentre"}).exit_code == 0);

  const ProgramResult large = daemon.ctl({"workspace", "scale", "100"});
  CHECK(large.exit_code == 1);
  CHECK_THAT(large.err, Contains("scale: expected 0.1 to 10, found 100"));
  const ProgramResult mistyped = daemon.ctl({"workspace", "recenter"});
  CHECK(mistyped.exit_code > 100);
  CHECK_THAT(mistyped.err, Contains("did you mean 'recentre'?"));
  CHECK_THAT(daemon.ctl({"workspace", "clutch", "onn"}).err, Contains("did you mean 'on'?"));
  CHECK(daemon.ask({"workspace"}) == Json({{"clutched", true}, {"scale", 2.0}}));
}

}  // namespace
}  // namespace wrenchd::test_live_workspace
