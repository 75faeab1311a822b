// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <atomic>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "daemon/servo/two_loops.hpp"
#include "daemon/servo_thread.hpp"
#include "daemon/wall_clock.hpp"
#include "tests/support/no_allocation.hpp"
#include "tests/support/rate_check.hpp"
#include "tests/support/simulated_hand.hpp"
#include "tests/support/soon.hpp"

namespace wrenchd::test_two_loops {

namespace {

using namespace test;
using namespace std::chrono_literals;

template <class TheClock>
struct TwoHands {
  TheClock clock;
  SimulatedHand first, second;

  explicit TwoHands(ProxySearchMode search, const RunConfig& config = shipped_config())
      : first(config, clock, search), second(config, clock, search) {}
};

/// Two hands in virtual time, whose loops are attached.
struct VirtualHands : TwoHands<VirtualClock> {
  TwoLoops loops{clock.now(), 1ms};

  VirtualHands() : TwoHands(ProxySearchMode::in_tick) {
    loops.attach(0, first.loop());
    loops.attach(1, second.loop());
  }
  void run(double duration_s) {
    for (const TimePoint end = clock.now() + from_seconds(duration_s); clock.now() < end;) loops.step(clock);
  }
};

}  // namespace

TEST_CASE("two loops tick at the rate, the second half a period after the first", "[two_loops]") {
  VirtualHands hands;
  for (int i = 0; i < 100; ++i) {
    hands.loops.step(hands.clock);
    const std::int64_t first_ns = hands.first.newest().now_ns;
    hands.loops.step(hands.clock);
    CHECK(first_ns == (i + 1) * 1'000'000);
    CHECK(hands.second.newest().now_ns == first_ns + 500'000);
  }
  CHECK(hands.first.ticks() == 100);
  CHECK(hands.second.ticks() == 100);
  CHECK(hands.first.loop().telemetry().timing().skipped_ticks.load() == 0);
}

TEST_CASE("a hand whose device is lost is detached, and the other goes on", "[two_loops]") {
  VirtualHands hands;
  hands.second.device.inject({SimulatedFault::Kind::unplug, from_seconds(0.5), from_seconds(0.2)});
  for (SimulatedHand* hand : {&hands.first, &hands.second}) hand->loop().requests().arm();
  hands.run(0.4);
  CHECK(is_driving(hands.first.state()));
  CHECK(is_driving(hands.second.state()));
  hands.run(0.2);
  CHECK_FALSE(hands.loops.attached(1));
  CHECK(hands.loops.fault(1) == Fault::device_lost);
  CHECK(hands.loops.attached(0));
  const std::uint64_t lost_at = hands.second.ticks(), before = hands.first.ticks();
  hands.run(0.2);
  CHECK(hands.second.ticks() == lost_at);
  CHECK(hands.first.ticks() == before + 200);
  CHECK(is_driving(hands.first.state()));

  hands.second.runtime.open();
  hands.loops.attach(1, hands.second.loop());
  hands.run(0.1);
  CHECK(hands.loops.attached(1));
  CHECK(hands.second.state() == State::disarmed);  // a device that returns is disarmed
  CHECK(hands.second.newest().now_ns % 1'000'000 == 500'000);
}

TEST_CASE("a loop that is asked to end fades out, releases and is detached alone", "[two_loops]") {
  VirtualHands hands;
  hands.first.loop().requests().arm();
  hands.second.loop().requests().arm();
  hands.run(2.0);
  REQUIRE(hands.first.state() == State::active);
  hands.loops.end(0);
  hands.run(0.01);
  CHECK(hands.loops.attached(0));  // the force fades
  hands.run(0.5);
  CHECK_FALSE(hands.loops.attached(0));
  CHECK(hands.loops.fault(0) == Fault::none);
  CHECK(hands.first.state() == State::shutdown);
  CHECK(hands.first.newest().released == 1);
  CHECK(hands.second.state() == State::active);

  hands.loops.end(1);
  const std::atomic<bool> stop{true};
  hands.loops.run(hands.clock, stop);
  CHECK(hands.second.state() == State::shutdown);
}

TEST_CASE("ticks that are missed are counted for the loop that missed them", "[two_loops]") {
  VirtualHands hands;
  hands.run(0.01);
  hands.clock.sleep_until(hands.clock.now() + 5ms);  // as a tick that takes so long
  hands.loops.step(hands.clock);
  hands.loops.step(hands.clock);
  hands.loops.step(hands.clock);
  CHECK(hands.first.loop().telemetry().timing().skipped_ticks.load() == 4);
  CHECK(hands.second.loop().telemetry().timing().skipped_ticks.load() == 4);
  hands.run(0.01);
  CHECK(hands.first.newest().now_ns % 1'000'000 == 0);  // the due times are the same
  CHECK(hands.second.newest().now_ns % 1'000'000 == 500'000);
}

TEST_CASE("two loops neither allocate nor lock, also when a device is lost and a loop ends",
          "[two_loops][realtime]") {
  VirtualHands hands;
  hands.second.device.inject({SimulatedFault::Kind::unplug, from_seconds(3.0), from_seconds(10.0)});
  for (SimulatedHand* hand : {&hands.first, &hands.second}) hand->loop().requests().arm();
  std::uint64_t allocations = 0, locks = 0;
  {
    const RealtimeGuard guard;
    hands.run(4.0);
    hands.loops.end(0);
    hands.run(0.5);
    allocations = guard.allocations();
    locks = guard.locks();
  }
  CHECK(hands.loops.fault(1) == Fault::device_lost);
  CHECK_FALSE(hands.loops.attached(0));
  CHECK(hands.first.ticks() > 4000);
  CHECK(allocations == 0);
  CHECK(locks == 0);
}

TEST_CASE("one thread serves two hands in wall time, and each comes and goes by itself",
          "[two_loops][wall_time]") {
  const MachineLoad load;
  RunConfig config = shipped_config();
  config.settings.servo.realtime = Realtime::off;
  TwoHands<WallClock> hands(ProxySearchMode::background, config);
  hands.second.device.inject({SimulatedFault::Kind::unplug, from_seconds(2.0), from_seconds(0.3)});
  TwoHandThread thread(config.settings.servo, hands.clock);
  auto first = thread.run(0, hands.first.loop());
  auto second = thread.run(1, hands.second.loop());
  CHECK(first->thread() == second->thread());
  std::this_thread::sleep_for(1s);
  const std::uint64_t ticks = hands.first.ticks();
  CHECK(hands.second.ticks() > 0);
  REQUIRE_RATE(load, ticks > 900 && ticks <= 1001);
  REQUIRE_RATE(load, hands.second.ticks() > 900 && hands.second.ticks() <= 1001);

  REQUIRE(soon([&] { return second->ended(); }));
  CHECK(second->join() == Fault::device_lost);
  CHECK_FALSE(first->ended());
  hands.second.runtime.close();
  REQUIRE(soon([&] {
    try {
      hands.second.runtime.open();
      return true;
    } catch (const std::runtime_error&) {  // still unplugged
      return false;
    }
  }));
  second = thread.run(1, hands.second.loop());
  const std::uint64_t before = hands.second.ticks();
  CHECK(soon([&] { return hands.second.ticks() > before + 10; }));

  CHECK(first->join() == Fault::none);
  CHECK(hands.first.state() == State::shutdown);
  CHECK_FALSE(second->ended());
  second.reset();  // joins
  CHECK(hands.second.state() == State::shutdown);
}

}  // namespace wrenchd::test_two_loops
