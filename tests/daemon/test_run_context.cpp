// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "daemon/run_context.hpp"
#include "tests/support/shipped_config.hpp"

namespace wrenchd::test_run_context {

namespace {

using namespace test;

TEST_CASE("a run reports the fault of a latched loop until its acknowledgement", "[run_context]") {
  VirtualRuntime r;
  r.run(0.1);
  CHECK(latched_fault(r.runtime.loop()) == Fault::none);
  r.runtime.loop().requests().stop();
  r.tick();
  REQUIRE(r.state() == State::stopped);
  CHECK(latched_fault(r.runtime.loop()) == Fault::stop_requested);
  r.runtime.loop().requests().acknowledge();
  r.tick();
  REQUIRE(r.state() != State::stopped);
  CHECK(latched_fault(r.runtime.loop()) == Fault::none);
}

}  // namespace
}  // namespace wrenchd::test_run_context
