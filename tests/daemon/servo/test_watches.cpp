// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "core/watch_limits.hpp"
#include "daemon/servo/pace_watch.hpp"
#include "daemon/servo/watches.hpp"
#include "daemon/servo/write_watch.hpp"

namespace wrenchd::test_watches {

// What tests/daemon/servo/test_fault_reactions.cpp does not see of the watches: where they must not find
// anything.

using namespace std::chrono_literals;

namespace {

DeviceSample sample_at(TimePoint now, double device_time_s) {
  DeviceSample sample;
  sample.arrived = now;
  sample.device_time_s = device_time_s;
  sample.fresh = true;
  return sample;
}

}  // namespace

TEST_CASE("one bad report in four is tolerated for ever, one in two is not", "[watches]") {
  for (const int one_in : {4, 2}) {
    LinkWatch watch(1000.0);
    FaultSet faults = 0;
    for (int i = 1; i < 5000; ++i) {
      DeviceSample sample = sample_at(TimePoint{} + i * 1ms, 1e-3 * i);
      if (i % one_in == 0) {
        sample.rejected = 1;
        sample.fresh = false;
      }
      faults |= watch.check(sample, sample.arrived);
    }
    CHECK(((faults & bit(Fault::link_lossy)) != 0) == (one_in == 2));
    CHECK((faults & bit(Fault::report_malformed)) != 0);
  }
}

TEST_CASE("clock drift is no lag; a queue that delays reports is", "[watches]") {
  LinkWatch watch(1000.0);
  const auto check = [&](int i, double lag_s, double rate) {
    const TimePoint now = TimePoint{} + i * 1ms;
    return watch.check(sample_at(now, rate * 1e-3 * i - lag_s), now) & bit(Fault::sample_late);
  };
  for (int i = 1; i < 100000; ++i) REQUIRE(check(i, 0.0, 1.0 - 1e-4) == 0);
  for (int i = 100000; i < 100100; ++i) REQUIRE(check(i, 0.002, 1.0 - 1e-4) == 0);
  CHECK(check(100100, 0.004, 1.0 - 1e-4) != 0);
}

TEST_CASE("a sample of a device with slow reports is late after three report periods", "[watches]") {
  LinkWatch watch(125.0);
  const TimePoint start{1s};
  CHECK(watch.check(sample_at(start, 0.0), start) == 0);
  DeviceSample old = sample_at(start, 0.0);
  old.fresh = false;
  CHECK(watch.check(old, start + 20ms) == 0);
  CHECK(watch.check(old, start + 25ms) == bit(Fault::sample_late));
}

TEST_CASE("a handle at rest is not stuck, with a zero twist or with noise", "[watches]") {
  PoseWatch watch{DeviceProfile{}};
  for (int i = 0; i < 5000; ++i) {
    DeviceSample sample = sample_at(TimePoint{} + i * 1ms, 1e-3 * i);
    sample.V_BH.linear_m_per_s.x() = i < 2500 ? 0.0 : 1e-6;
    REQUIRE(watch.check(sample) == 0);
  }
}

TEST_CASE("two invalid rotations in a row are no fault", "[watches]") {
  PoseWatch watch{DeviceProfile{}};
  for (int i = 0; i < 30; ++i) {
    DeviceSample sample = sample_at(TimePoint{} + i * 1ms, 1e-3 * i);
    if (i % 3 != 0) sample.fault = Fault::pose_not_a_rotation;
    REQUIRE(watch.check(sample) == 0);
  }
}

TEST_CASE("a watchdog flag from before the motors were enabled is no fault", "[watches]") {
  MotorWatch watch;
  DeviceSample sample = sample_at(TimePoint{}, 0.0);
  sample.watchdog_tripped = true;
  for (int i = 0; i < 100; ++i) REQUIRE(watch.check(sample, false, TimePoint{} + i * 1ms) == 0);
  for (int i = 100; i < 110; ++i) REQUIRE(watch.check(sample, true, TimePoint{} + i * 1ms) == 0);
  sample.watchdog_tripped = false;
  sample.motors_on = true;
  CHECK(watch.check(sample, true, TimePoint{} + 110ms) == 0);
  sample.motors_on = false;
  sample.watchdog_tripped = true;
  CHECK(watch.check(sample, true, TimePoint{} + 111ms) == bit(Fault::watchdog_tripped));
}

TEST_CASE("single failed writes are no fault; 2 ms and 20 ms of failed writes are", "[watches]") {
  WriteWatch watch;
  TimePoint now{};
  for (int i = 0; i < 100; ++i, now += 1ms)
    REQUIRE(watch.check(i % 2 == 0 ? Fault::write_failed : Fault::none, now) == 0);
  for (; now < TimePoint{} + 102ms; now += 1ms) watch.check(Fault::write_failed, now);
  CHECK(watch.check(Fault::write_failed, now) == bit(Fault::write_blocked));
  CHECK(watch.check(Fault::write_failed, now + 25ms) == bit(Fault::write_failed));
}

TEST_CASE("punctual and slightly late ticks are no fault; dt is clamped to two periods", "[watches]") {
  PaceWatch watch(1ms, 20ms);
  TimePoint now{5s};
  CHECK(watch.check(now, 0ns) == 0);
  CHECK(watch.dt_s() == Approx(1e-3));
  CHECK(watch.check(now += 6ms, 0ns) == 0);
  CHECK(watch.dt_s() == Approx(2e-3));
  CHECK(watch.check(now += 7ms, 0ns) == bit(Fault::tick_late));
  CHECK(watch.check(now += 22ms, 0ns) == bit(Fault::loop_stalled));
  CHECK(watch.check(now += 1ms, 50ms) == 0);  // 50 ms is no suspension
  CHECK(watch.check(now += 1ms, 1h) == bit(Fault::suspended));
  CHECK(watch.check(now - 1ns, 1h) == bit(Fault::clock_reversed));
  CHECK(watch.dt_s() == 0.0);
}

TEST_CASE("full force on a moving handle is no stall, nor is 400 ms of full force on a still handle",
          "[watches]") {
  MotorStallWatch watch(10.0, 0.5);
  const Wrench F{{0, 0, 9.9}, {0, 0, 0}};
  Pose X_BH;
  TimePoint now{};
  for (int i = 0; i < 5000; ++i, now += 1ms) {
    X_BH.translation_m.x() = 2e-6 * i;
    REQUIRE(watch.check(F, X_BH, now) == 0);
  }
  for (int i = 0; i < 400; ++i, now += 1ms) REQUIRE(watch.check(F, X_BH, now) == 0);
  CHECK(watch.check(Wrench{}, X_BH, now) == 0);
  for (int i = 0; i < 1000; ++i, now += 1ms) REQUIRE(watch.check({{0, 0, 0}, {0, 0.49, 0}}, X_BH, now) == 0);
  CHECK(watch.check({{0, 0, 0}, {0, 0.49, 0}}, X_BH, now + 1ms) == bit(Fault::motors_stalled));
}

TEST_CASE("a client with a lease must send heartbeats; without a lease there is no timeout", "[watches]") {
  ClientWatch watch;
  CHECK(watch.check(TimePoint{1h}) == 0);
  watch.start(TimePoint{});
  for (int i = 0; i < 50; ++i) {
    watch.heartbeat(TimePoint{} + i * 90ms);
    REQUIRE(watch.check(TimePoint{} + i * 90ms + 89ms) == 0);
  }
  CHECK(watch.check(TimePoint{} + 50 * 90ms + 20ms) == bit(Fault::heartbeat_lost));
  watch.start(TimePoint{1min});
  CHECK(watch.check(TimePoint{1min} + 101ms) == bit(Fault::heartbeat_missing));
  watch.stop();
  CHECK(watch.check(TimePoint{1h}) == 0);
}

TEST_CASE("a closed connection of a client with a lease is a fault at once", "[watches]") {
  ClientWatch watch;
  watch.client_lost();
  CHECK(watch.check(TimePoint{1s}) == 0);  // no lease, no fault
  watch.start(TimePoint{1s});
  watch.heartbeat(TimePoint{1s});
  CHECK(watch.check(TimePoint{1s}) == 0);
  watch.client_lost();
  CHECK(watch.check(TimePoint{1s}) == bit(Fault::heartbeat_lost));
  watch.stop();
  CHECK(watch.check(TimePoint{1s}) == 0);
  watch.start(TimePoint{2s});  // a new lease starts without a fault
  CHECK(watch.check(TimePoint{2s}) == 0);
}

}  // namespace wrenchd::test_watches
