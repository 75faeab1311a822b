// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "daemon/control/lease.hpp"
#include "tests/support/control_rig.hpp"

namespace wrenchd::test_lease {

namespace {

using namespace test;
using namespace std::chrono_literals;

const Lease::Holder kA{2, "A"}, kB{3, "B"};

/// A loop in virtual time with the hand at rest, and a lease.
struct Rig {
  VirtualRuntime s{resting_config()};
  EventFeed feed{s.runtime.loop()};
  Lease lease{s.runtime.loop(), feed};

  Rig() { s.run(0.05); }
  void arm_by(const Lease::Holder& holder) {
    lease.acquire(holder, s.clock.now());
    lease.arm(s.clock.now());
    for (int i = 0; i < 1000 && s.state() != State::active; ++i) heartbeat_and_tick();
    REQUIRE(s.state() == State::active);
  }
  void heartbeat_and_tick() {
    lease.heartbeat(s.clock.now());
    s.tick();
  }
};

TEST_CASE("the loop stays armed while the holder of the lease sends heartbeats", "[lease]") {
  Rig r;
  r.arm_by(kA);
  CHECK(r.lease.armed());
  for (int i = 0; i < 30; ++i) {
    r.s.run(0.09);
    r.lease.check(r.s.clock.now());
    r.lease.heartbeat(r.s.clock.now());
  }
  CHECK(r.s.state() == State::active);
  CHECK(r.lease.held_by(kA.client));
}

TEST_CASE("a holder without heartbeats loses the lease, and the loop releases the hand without a lease check",
          "[lease]") {
  Rig r;
  r.arm_by(kA);
  const TimePoint last = r.s.clock.now();
  r.lease.heartbeat(last);
  while (r.s.state() == State::active) r.s.tick();
  CHECK(r.s.clock.now() - last <= 103ms);
  CHECK(r.s.clock.now() - last > 99ms);
  CHECK(r.s.cause() == Fault::heartbeat_lost);
  r.lease.check(r.s.clock.now());
  CHECK_FALSE(r.lease.holder());
  CHECK_FALSE(r.lease.armed());
}

TEST_CASE("a lease that did not arm also ends without heartbeats", "[lease]") {
  Rig r;
  CHECK(r.lease.next_check_at() == TimePoint::max());
  r.lease.acquire(kA, r.s.clock.now());
  r.lease.check(r.s.clock.now() + 100ms);
  CHECK(r.lease.held_by(kA.client));
  CHECK(r.lease.next_check_at() - r.s.clock.now() == 101ms);
  r.lease.check(r.lease.next_check_at());
  CHECK_FALSE(r.lease.holder());
}

TEST_CASE("a holder that disconnects releases the hand in the next tick", "[lease]") {
  Rig r;
  r.arm_by(kA);
  r.lease.client_lost(kB.client);
  r.s.tick();
  CHECK(r.s.state() == State::active);
  r.lease.client_lost(kA.client);
  CHECK_FALSE(r.lease.holder());
  r.s.tick();
  CHECK(r.s.state() == State::releasing);
  CHECK(r.s.cause() == Fault::heartbeat_lost);
}

TEST_CASE("a loop that was armed without the lease stays armed when the lease ends", "[lease]") {
  Rig r;
  r.s.runtime.loop().requests().arm();
  r.s.run(1.0);
  REQUIRE(r.s.state() == State::active);
  r.lease.acquire(kA, r.s.clock.now());
  CHECK_FALSE(r.lease.armed());
  r.lease.client_lost(kA.client);
  r.s.run(0.3);
  r.lease.acquire(kB, r.s.clock.now());
  r.lease.check(r.s.clock.now() + 1s);
  r.lease.acquire(kB, r.s.clock.now());
  r.lease.release("released it");
  r.s.run(0.3);
  CHECK(r.s.state() == State::active);
}

TEST_CASE("a preempting client disarms what the previous holder armed, and can arm", "[lease]") {
  Rig r;
  r.arm_by(kA);
  r.lease.preempt(kB, r.s.clock.now());
  CHECK(r.lease.held_by(kB.client));
  CHECK_FALSE(r.lease.armed());
  for (int i = 0; i < 200; ++i) r.heartbeat_and_tick();
  CHECK(r.s.state() == State::disarmed);
  r.arm_by(kB);
  r.lease.client_lost(kA.client);
  r.s.tick();
  CHECK(r.s.state() == State::active);
  r.lease.release("released it");
  r.s.tick();
  CHECK(r.s.state() == State::releasing);
}

TEST_CASE("every change of the lease is an event", "[lease]") {
  Rig r;
  const std::uint64_t before = r.feed.snapshot().sequence;
  r.lease.acquire(kA, r.s.clock.now());
  r.lease.acquire(kA, r.s.clock.now());  // it already holds the lease
  r.lease.preempt(kB, r.s.clock.now());
  r.lease.client_lost(kB.client);
  r.lease.acquire(kA, r.s.clock.now());
  r.lease.check(r.s.clock.now() + 1s);
  std::vector<Json> holders;
  for (const std::string& line : r.feed.events_since(before + 1, {"lease"}, 100000).lines)
    holders.push_back(Json::parse(line)["params"]["holder"]);
  CHECK(holders == std::vector<Json>{"A", nullptr, "B", nullptr, "A", nullptr});
}

TEST_CASE("a holder that has disarmed may leave without a fault, at once and during the fade", "[lease]") {
  for (const int ticks_of_fade : {0, 1, 40, 300}) {
    Rig r;
    r.arm_by(kA);
    r.lease.disarm();
    for (int i = 0; i < ticks_of_fade; ++i) r.s.tick();  // without heartbeats
    r.lease.client_lost(kA.client);
    CHECK_FALSE(r.lease.holder());
    FaultSet faults = 0;
    for (int i = 0; i < 300; ++i) {
      r.s.tick();
      faults |= r.s.last.faults;
    }
    INFO(ticks_of_fade);
    CHECK(faults == 0);
    CHECK(r.s.state() == State::disarmed);
    r.feed.drain();
    for (const std::string& line : r.feed.events_since(1, {"fault", "lease"}, 1 << 20).lines)
      CHECK(Json::parse(line)["params"]["level"] == "info");
  }
}

TEST_CASE("a holder that arms again after it has disarmed is watched again", "[lease]") {
  Rig r;
  r.arm_by(kA);
  r.lease.disarm();
  r.s.run(0.3);
  r.arm_by(kA);
  r.lease.client_lost(kA.client);
  r.s.tick();
  CHECK(r.s.cause() == Fault::heartbeat_lost);
}

}  // namespace
}  // namespace wrenchd::test_lease
