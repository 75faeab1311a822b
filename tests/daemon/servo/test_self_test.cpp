// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "daemon/servo/self_test.hpp"

using namespace wrenchd;
using namespace std::chrono_literals;

namespace {

/// A device of 1 kHz with a watchdog of 8 ms, and the test that looks at it, a millisecond a tick.
struct Bench {
  DeviceProfile profile;
  SelfTest test;
  DeviceSample sample;
  TimePoint now{1h};
  FaultSet found = 0;
  Fault said = Fault::none;
  bool works = true;  ///< its watchdog
  bool wakes = true;  ///< its motors come on when they are told to
  int silent_ticks = 0;

  explicit Bench(bool can_tell = true) : profile(profile_of(can_tell)), test(profile, 0.5) {
    test.start(now);
  }

  static DeviceProfile profile_of(bool can_tell) {
    DeviceProfile p;
    p.report_rate_Hz = 1000.0;
    p.watchdog_s = 0.008;
    p.pose_report.sequence.present = true;
    p.pose_report.motors_on.present = p.pose_report.watchdog_tripped.present = can_tell;
    return p;
  }
  void tick() {
    now += 1ms;
    ++sample.sequence;
    sample.arrived = now;
    sample.fresh = true;
    silent_ticks = test.sends_commands() ? 0 : silent_ticks + 1;
    if (test.sends_commands()) {
      sample.motors_on = wakes && test.motors_on();
      if (test.motors_on()) sample.watchdog_tripped = false;
    } else if (works && silent_ticks > 8) {
      sample.watchdog_tripped = sample.watchdog_tripped || sample.motors_on;
      sample.motors_on = false;
    }
    if (said == Fault::none) said = test.check(sample, found, now);
  }
  int ticks_until_passed(int most) {
    for (int i = 1; i <= most; ++i) {
      tick();
      if (test.passed()) return i;
    }
    return -1;
  }
};

}  // namespace

TEST_CASE("half a second of good reports and a watchdog that trips, and the test has passed", "[self_test]") {
  Bench bench;
  const int ticks = bench.ticks_until_passed(1000);
  CHECK(ticks > 500);
  CHECK(ticks < 530);
  CHECK(bench.said == Fault::none);
  CHECK(bench.test.report_rate_Hz() == Approx(1000.0));
}

TEST_CASE("the motors are on for a moment only, and then nothing is said until the watchdog trips",
          "[self_test]") {
  Bench bench;
  int driven = 0, silent = 0;
  while (!bench.test.passed()) {
    bench.tick();
    driven += bench.test.motors_on() ? 1 : 0;
    silent += bench.test.sends_commands() ? 0 : 1;
    REQUIRE(driven + silent < 60);
  }
  CHECK(driven >= 1);
  CHECK(driven < 5);
  CHECK(silent >= 8);
}

TEST_CASE("a bad report, and the half second begins anew", "[self_test]") {
  for (const Fault bad :
       {Fault::report_malformed, Fault::report_repeated, Fault::report_missing, Fault::sample_late}) {
    Bench bench;
    for (int i = 0; i < 400; ++i) bench.tick();
    bench.found = bit(bad);
    bench.tick();
    bench.found = 0;
    const int more = bench.ticks_until_passed(1000);
    CHECK(more > 500);
  }
  Bench unclean;
  for (int i = 0; i < 6000; ++i) {
    unclean.found = i % 100 == 0 ? bit(Fault::report_missing) : 0;
    unclean.tick();
  }
  CHECK(unclean.said == Fault::self_test_reports);
}

TEST_CASE("a tick that came late is no fault of the device's", "[self_test]") {
  Bench bench;
  bench.found = bit(Fault::tick_late);
  CHECK(bench.ticks_until_passed(1000) > 0);
}

TEST_CASE("another rate than the profile's is told", "[self_test]") {
  for (const unsigned step : {0U, 1U}) {
    Bench bench;
    for (int i = 0; i < 600 && bench.said == Fault::none; ++i) {
      bench.sample.sequence += i % 5 == 0 ? step : 0U;  // 1200 a second
      bench.tick();
    }
    CHECK(bench.said == (step == 1 ? Fault::self_test_rate : Fault::none));
  }
}

TEST_CASE("a watchdog that does not trip is told; where it cannot be seen it is not asked", "[self_test]") {
  Bench asleep;
  asleep.works = false;
  CHECK(asleep.ticks_until_passed(1000) == -1);
  CHECK(asleep.said == Fault::self_test_watchdog);
  Bench mute(false);
  mute.works = false;
  CHECK(mute.ticks_until_passed(1000) > 0);
}

TEST_CASE("motors that do not come on when they are told to are told, and nothing is waited for",
          "[self_test]") {
  Bench bench;
  bench.wakes = false;
  CHECK(bench.ticks_until_passed(2000) == -1);
  CHECK(bench.said == Fault::self_test_watchdog);
  CHECK(bench.test.sends_commands());  // it has not come to the silence in which the watchdog would trip
}

TEST_CASE("a device that has to be homed first has all the time it needs", "[self_test]") {
  Bench bench;
  bench.sample.homed = false;
  for (int i = 0; i < 20000; ++i) bench.tick();
  CHECK(bench.said == Fault::none);
  CHECK_FALSE(bench.test.passed());
  bench.sample.homed = true;
  CHECK(bench.ticks_until_passed(1000) > 500);
}
