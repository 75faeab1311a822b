// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "daemon/servo/self_test.hpp"

namespace wrenchd::test_self_test {

using namespace std::chrono_literals;

namespace {

/// A device with 1 kHz reports and a watchdog of 8 ms, and its self-test. Each tick takes 1 ms.
struct Bench {
  DeviceProfile profile;
  SelfTest test;
  DeviceSample sample;
  TimePoint now{1h};
  FaultSet found = 0;
  Fault failure = Fault::none;
  bool watchdog_works = true;  ///< False if the device watchdog never trips.
  bool motors_work = true;     ///< False if the motors never switch on.
  int silent_ticks = 0;

  explicit Bench(bool reports_watchdog = true) : profile(profile_of(reports_watchdog)), test(profile, 0.5) {
    test.start(now);
  }

  static DeviceProfile profile_of(bool reports_watchdog) {
    DeviceProfile p;
    p.report_rate_Hz = 1000.0;
    p.watchdog_s = 0.008;
    p.pose_report.sequence.present = true;
    p.pose_report.motors_on.present = p.pose_report.watchdog_tripped.present = reports_watchdog;
    return p;
  }
  void tick() {
    now += 1ms;
    ++sample.sequence;
    sample.arrived = now;
    sample.fresh = true;
    silent_ticks = test.sends_commands() ? 0 : silent_ticks + 1;
    if (test.sends_commands()) {
      sample.motors_on = motors_work && test.motors_on();
      if (test.motors_on()) sample.watchdog_tripped = false;
    } else if (watchdog_works && silent_ticks > 8) {
      sample.watchdog_tripped = sample.watchdog_tripped || sample.motors_on;
      sample.motors_on = false;
    }
    if (failure == Fault::none) failure = test.check(sample, found, now);
  }
  int ticks_until_passed(int max_ticks) {
    for (int i = 1; i <= max_ticks; ++i) {
      tick();
      if (test.passed()) return i;
    }
    return -1;
  }
};

}  // namespace

TEST_CASE("the test passes after 500 ms of faultless reports and a watchdog trip", "[self_test]") {
  Bench bench;
  const int ticks = bench.ticks_until_passed(1000);
  CHECK(ticks > 500);
  CHECK(ticks < 530);
  CHECK(bench.failure == Fault::none);
  CHECK(bench.test.report_rate_Hz() == Approx(1000.0));
}

TEST_CASE("the motors are on for a few ticks, then nothing is sent until the watchdog trips", "[self_test]") {
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

TEST_CASE("a faulty report restarts the 500 ms", "[self_test]") {
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
  CHECK(unclean.failure == Fault::self_test_reports);
}

TEST_CASE("a late tick does not restart the 500 ms", "[self_test]") {
  Bench bench;
  bench.found = bit(Fault::tick_late);
  CHECK(bench.ticks_until_passed(1000) > 0);
}

TEST_CASE("a report rate that differs from the profile fails the test", "[self_test]") {
  for (const unsigned step : {0U, 1U}) {
    Bench bench;
    for (int i = 0; i < 600 && bench.failure == Fault::none; ++i) {
      bench.sample.sequence += i % 5 == 0 ? step : 0U;  // 1200 Hz
      bench.tick();
    }
    CHECK(bench.failure == (step == 1 ? Fault::self_test_rate : Fault::none));
  }
}

TEST_CASE("a watchdog that does not trip fails the test; a device without the flags skips that part",
          "[self_test]") {
  Bench asleep;
  asleep.watchdog_works = false;
  CHECK(asleep.ticks_until_passed(1000) == -1);
  CHECK(asleep.failure == Fault::self_test_watchdog);
  Bench without_flags(false);
  without_flags.watchdog_works = false;
  CHECK(without_flags.ticks_until_passed(1000) > 0);
}

TEST_CASE("motors that do not switch on fail the test at once", "[self_test]") {
  Bench bench;
  bench.motors_work = false;
  CHECK(bench.ticks_until_passed(2000) == -1);
  CHECK(bench.failure == Fault::self_test_watchdog);
  CHECK(bench.test.sends_commands());  // the test failed before it stopped sending
}

TEST_CASE("the timeout does not run before the device is homed", "[self_test]") {
  Bench bench;
  bench.sample.homed = false;
  for (int i = 0; i < 20000; ++i) bench.tick();
  CHECK(bench.failure == Fault::none);
  CHECK_FALSE(bench.test.passed());
  bench.sample.homed = true;
  CHECK(bench.ticks_until_passed(1000) > 500);
}

}  // namespace wrenchd::test_self_test
