// SPDX-License-Identifier: GPL-3.0-or-later
#include <chrono>

#include <catch2/catch.hpp>

#include "daemon/contact_rate.hpp"

namespace wrenchd::test_contact_rate {

using namespace std::chrono_literals;

namespace {

void add(LoopTiming& timing, int ticks, Duration duration) {
  for (int i = 0; i < ticks; ++i) timing.tick.add(duration);
}

}  // namespace

TEST_CASE("after five seconds the rate that the scene allows is reported once", "[contact_rate]") {
  LoopTiming timing;
  ContactRateReport report(1000.0);
  add(timing, 4999, 3ms);
  CHECK_FALSE(report.check(timing));
  add(timing, 1, 3ms);
  const auto message = report.check(timing);
  REQUIRE(message);
  CHECK(message->too_slow);
  CHECK_THAT(message->text, Catch::Contains("allows 3") && Catch::Contains("runs at 1000 Hz") &&
                                Catch::Contains("contacts = \"native\"") &&
                                Catch::Contains("--virtual-time"));
  CHECK_THAT(message->text, !Catch::Contains("lower rate_Hz"));  // 500 Hz is the lowest
  CHECK_FALSE(report.check(timing));
  CHECK_FALSE(report.close(timing));
}

TEST_CASE("a scene that allows the rate is reported without advice, and again when it becomes slower",
          "[contact_rate]") {
  LoopTiming timing;
  ContactRateReport report(1000.0);
  add(timing, 5000, 200us);
  const auto fast = report.check(timing);
  REQUIRE(fast);
  CHECK_FALSE(fast->too_slow);
  CHECK_THAT(fast->text, !Catch::Contains("native"));
  add(timing, 100, 1300us);
  const auto slow = report.check(timing);
  REQUIRE(slow);
  CHECK(slow->too_slow);
  CHECK_THAT(slow->text, Catch::Contains("a lower rate_Hz"));
}

TEST_CASE("twenty overruns are reported at once", "[contact_rate]") {
  LoopTiming timing;
  ContactRateReport report(1000.0);
  add(timing, 100, 10ms);
  timing.overruns = 19;
  CHECK_FALSE(report.check(timing));
  timing.overruns = 20;
  CHECK(report.check(timing)->too_slow);
}

TEST_CASE("a short run is reported at its end", "[contact_rate]") {
  LoopTiming timing;
  ContactRateReport report(1000.0);
  CHECK_FALSE(report.close(timing));
  add(timing, 10, 2ms);
  CHECK_FALSE(report.check(timing));
  CHECK(report.close(timing));
  CHECK_FALSE(report.close(timing));
}

}  // namespace wrenchd::test_contact_rate
