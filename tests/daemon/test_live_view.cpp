// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <string>

#include <catch2/catch.hpp>

#include "daemon/live_view.hpp"
#include "tests/support/shipped_config.hpp"

namespace wrenchd::test_live_view {

namespace {

using namespace test;

/// Runs a tick, and leaves its record to the live view: a record is taken once.
void tick(VirtualRuntime& r) {
  r.clock.sleep_until(r.clock.now() + std::chrono::milliseconds(1));
  r.runtime.loop().tick(r.clock.now(), r.clock.now());
}

TEST_CASE("without a terminal the live view prints every fifth sample, and a summary", "[live_view]") {
  VirtualRuntime r;
  std::string printed;
  LiveView view([&](const std::string& text) { printed += text; }, false, r.runtime.config().profile);
  view.sample(r.runtime.loop());  // no tick yet
  for (int sample = 0; sample < 10; ++sample) {
    tick(r);
    view.sample(r.runtime.loop());
  }
  CHECK(std::count(printed.begin(), printed.end(), '\n') == 2);
  printed.clear();
  view.close(r.runtime.loop(), 1.0);
  CHECK(printed.starts_with("10 ticks in 1.00 s (1000.0 Hz); "));
  CHECK(std::count(printed.begin(), printed.end(), '\n') > 2);
}

TEST_CASE("on a terminal the live view overwrites its line", "[live_view]") {
  VirtualRuntime r;
  std::string printed;
  LiveView view([&](const std::string& text) { printed += text; }, true, r.runtime.config().profile);
  for (int sample = 0; sample < 3; ++sample) {
    tick(r);
    view.sample(r.runtime.loop());
  }
  CHECK(std::count(printed.begin(), printed.end(), '\r') == 3);
  CHECK(printed.find('\n') == std::string::npos);
}

TEST_CASE("a live view without an output prints nothing", "[live_view]") {
  VirtualRuntime r;
  LiveView view({}, false, r.runtime.config().profile);
  tick(r);
  view.sample(r.runtime.loop());
  view.close(r.runtime.loop(), 1.0);
}

}  // namespace
}  // namespace wrenchd::test_live_view
