// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "daemon/scheduled_requests.hpp"
#include "tests/support/shipped_config.hpp"

namespace wrenchd::test_scheduled_requests {

namespace {

using namespace test;

TEST_CASE("the loop is armed once, as soon as it is disarmed", "[scheduled_requests]") {
  VirtualRuntime r;
  ScheduledRequests requests(true, {}, r.clock.now());
  r.run(0.1);
  REQUIRE(r.state() == State::disarmed);
  requests.send_due(r.runtime.loop(), r.clock.now());
  r.tick();
  CHECK(r.state() != State::disarmed);
  r.runtime.loop().requests().disarm();
  r.run(0.2);
  REQUIRE(r.state() == State::disarmed);
  requests.send_due(r.runtime.loop(), r.clock.now());
  r.tick();
  CHECK(r.state() == State::disarmed);
}

TEST_CASE("a scheduled command is sent at its time, and once", "[scheduled_requests]") {
  VirtualRuntime r;
  const TimePoint start = r.clock.now();
  ScheduledRequests requests(false, {{from_seconds(0.05), kStop}}, start);
  CHECK(requests.next_time(TimePoint::max()) == start + from_seconds(0.05));
  CHECK(requests.next_time(start) == start);
  r.run(0.04);
  requests.send_due(r.runtime.loop(), r.clock.now());
  r.tick();
  CHECK(r.state() == State::disarmed);
  r.run(0.02);
  requests.send_due(r.runtime.loop(), r.clock.now());
  r.tick();
  CHECK(r.state() == State::stopped);
  CHECK(requests.next_time(TimePoint::max()) == TimePoint::max());
  r.runtime.loop().requests().acknowledge();
  r.tick();
  requests.send_due(r.runtime.loop(), r.clock.now());
  r.tick();
  CHECK(r.state() != State::stopped);
}

}  // namespace
}  // namespace wrenchd::test_scheduled_requests
