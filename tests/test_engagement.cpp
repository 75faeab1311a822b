// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <set>
#include <string>

#include <catch2/catch.hpp>

#include "core/engagement.hpp"
#include "tests/support/random_values.hpp"

using namespace wrenchd;
using test::RandomValues;

namespace {

constexpr double kTick_s = 1.0 / 1024.0;  // exact, so that times add up exactly
constexpr int kCalmTicks = 103;           // the first tick at which 100 ms have passed

/// Armed, calm for long enough, in the first tick of the ramp.
SoftStart ramping(double ramp_s) {
  SoftStart start(ramp_s);
  start.arm();
  while (start.state() == Engagement::waiting) start.advance(true, kTick_s);
  return start;
}

SoftStart active(double ramp_s) {
  SoftStart start = ramping(ramp_s);
  while (start.state() == Engagement::ramping) start.advance(true, kTick_s);
  return start;
}

}  // namespace

TEST_CASE("every start is disarmed, and stays so however calm the hand", "[engagement]") {
  SoftStart start(1.0);
  for (int i = 0; i < 10'000; ++i) {
    REQUIRE(start.advance(true, kTick_s) == 0.0);
    REQUIRE(start.state() == Engagement::disarmed);
  }
}

TEST_CASE("armed, it waits until the hand has been calm for a moment", "[engagement]") {
  SoftStart start(1.0);
  start.arm();
  CHECK(start.state() == Engagement::waiting);
  for (int i = 1; i < kCalmTicks; ++i) {
    REQUIRE(start.advance(true, kTick_s) == 0.0);
    REQUIRE(start.state() == Engagement::waiting);
  }
  CHECK(start.advance(true, kTick_s) == 0.0);
  CHECK(start.state() == Engagement::ramping);
}

TEST_CASE("time before arming is not time of calm", "[engagement]") {
  SoftStart start(1.0);
  for (int i = 0; i < 1'000; ++i) start.advance(true, kTick_s);
  start.arm();
  start.advance(true, kTick_s);
  CHECK(start.state() == Engagement::waiting);
}

TEST_CASE("one moment without calm and the wait starts again", "[engagement]") {
  SoftStart start(1.0);
  start.arm();
  for (int round = 0; round < 10; ++round) {
    for (int i = 1; i < kCalmTicks; ++i) start.advance(true, kTick_s);
    REQUIRE(start.advance(false, kTick_s) == 0.0);
    REQUIRE(start.state() == Engagement::waiting);
  }
  for (int i = 0; i < 10'000; ++i) REQUIRE(start.advance(false, kTick_s) == 0.0);
  for (int i = 1; i < kCalmTicks; ++i) start.advance(true, kTick_s);
  CHECK(start.state() == Engagement::waiting);
  start.advance(true, kTick_s);
  CHECK(start.state() == Engagement::ramping);
}

TEST_CASE("a long tick without calm is not calm either", "[engagement]") {
  SoftStart start(1.0);
  start.arm();
  CHECK(start.advance(false, 10.0) == 0.0);
  CHECK(start.state() == Engagement::waiting);
}

TEST_CASE("the ramp rises evenly from nothing to full authority in its time", "[engagement]") {
  for (const double ramp_s : {0.125, 1.0, 4.0}) {
    SoftStart start = ramping(ramp_s);
    const int ticks = static_cast<int>(ramp_s / kTick_s);
    for (int i = 1; i < ticks; ++i) {
      REQUIRE(start.advance(true, kTick_s) == Approx(i * kTick_s / ramp_s).epsilon(1e-14));
      REQUIRE(start.state() == Engagement::ramping);
    }
    REQUIRE(start.advance(true, kTick_s) == 1.0);
    REQUIRE(start.state() == Engagement::active);
    REQUIRE(start.advance(true, kTick_s) == 1.0);
  }
}

TEST_CASE("once on its way it does not ask for calm: a hand in contact moves", "[engagement]") {
  SoftStart start = ramping(1.0);
  double before = 0.0;
  for (int i = 0; i < 1'024; ++i) {
    const double authority = start.advance(false, kTick_s);
    REQUIRE(authority > before);
    before = authority;
  }
  CHECK(start.state() == Engagement::active);
  for (int i = 0; i < 1'000; ++i) REQUIRE(start.advance(false, kTick_s) == 1.0);
}

TEST_CASE("no ramp at all is a step", "[engagement]") {
  SoftStart start(0.0);
  start.arm();
  while (start.state() == Engagement::waiting) REQUIRE(start.advance(true, kTick_s) == 0.0);
  CHECK(start.advance(true, kTick_s) == 1.0);
  CHECK(start.state() == Engagement::active);
}

TEST_CASE("an interruption takes all authority at once and starts again from waiting", "[engagement]") {
  for (SoftStart start : {ramping(1.0), active(1.0)}) {
    start.interrupt();
    CHECK(start.state() == Engagement::waiting);
    CHECK(start.advance(true, kTick_s) == 0.0);
    for (int i = 2; i < kCalmTicks; ++i) REQUIRE(start.advance(true, kTick_s) == 0.0);
    CHECK(start.state() == Engagement::waiting);
    start.advance(true, kTick_s);
    CHECK(start.state() == Engagement::ramping);
  }
}

TEST_CASE("an interruption does not arm", "[engagement]") {
  SoftStart start(1.0);
  start.interrupt();
  CHECK(start.state() == Engagement::disarmed);
}

TEST_CASE("disarming takes all authority at once, and only arming gives it back", "[engagement]") {
  for (SoftStart start : {SoftStart(1.0), ramping(1.0), active(1.0)}) {
    start.disarm();
    CHECK(start.state() == Engagement::disarmed);
    for (int i = 0; i < 2'000; ++i) REQUIRE(start.advance(true, kTick_s) == 0.0);
    start.arm();
    CHECK(start.advance(true, kTick_s) == 0.0);
    CHECK(start.state() == Engagement::waiting);
  }
}

TEST_CASE("arming what is armed changes nothing", "[engagement]") {
  SoftStart start = ramping(1.0);
  const double before = start.advance(true, kTick_s);
  start.arm();
  CHECK(start.state() == Engagement::ramping);
  CHECK(start.advance(true, kTick_s) > before);
  SoftStart running = active(1.0);
  running.arm();
  CHECK(running.advance(true, kTick_s) == 1.0);
}

TEST_CASE("a clock that stands still or runs backwards gives no authority", "[engagement]") {
  SoftStart start(1.0);
  start.arm();
  for (int i = 0; i < 10'000; ++i) {
    start.advance(true, 0.0);
    start.advance(true, -1.0);
  }
  CHECK(start.state() == Engagement::waiting);
  start = ramping(1.0);
  const double before = start.advance(true, kTick_s);
  for (int i = 0; i < 1'000; ++i) REQUIRE(start.advance(true, -kTick_s) == before);
}

TEST_CASE(
    "whatever happens, authority stays from 0 to 1, rises no faster than the ramp and never skips the wait",
    "[engagement]") {
  RandomValues random(1);
  for (int run = 0; run < 200; ++run) {
    const double ramp_s = random.decades(0.01, 2.0);
    SoftStart start(ramp_s);
    double before = 0.0;
    double calm_s = 0.0;
    for (int i = 0; i < 2'000; ++i) {
      const int what = random.integer(0, 999);
      if (what < 5) start.arm();
      if (what == 5) start.disarm();
      if (what == 6) start.interrupt();
      const bool broken = what == 5 || what == 6;  // before this tick, whose own time counts again
      const bool calm = !random.chance(0.005);
      const double dt_s = random.decades(1e-4, 1e-2);
      calm_s = calm ? (broken ? 0.0 : calm_s) + dt_s : 0.0;
      const Engagement was = start.state();
      const double authority = start.advance(calm, dt_s);
      REQUIRE(authority >= 0.0);
      REQUIRE(authority <= 1.0);
      REQUIRE(authority <= before + dt_s / ramp_s * (1.0 + 1e-9) + 1e-12);
      if (broken) REQUIRE(authority == 0.0);
      if (was == Engagement::waiting && start.state() == Engagement::ramping)
        REQUIRE(calm_s >= kCalmFor_s * (1.0 - 1e-9));
      REQUIRE((start.state() == Engagement::active) == (authority == 1.0));
      before = authority;
    }
  }
}

TEST_CASE("each state has a name of its own", "[engagement]") {
  std::set<std::string> names;
  for (const Engagement state :
       {Engagement::disarmed, Engagement::waiting, Engagement::ramping, Engagement::active})
    names.insert(name(state));
  CHECK(names == std::set<std::string>{"disarmed", "waiting", "ramping", "active"});
  CHECK(std::string(name(static_cast<Engagement>(99))) == "unknown");
}
