// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "core/state_machine.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test_state_machine {

using test::RandomValues;

namespace {

constexpr double kTick_s = 1.0 / 1024.0;  // exact, so that times add up exactly
constexpr int kCalmTicks = 103;           // the first tick at which 100 ms have passed

StateMachine disarmed(double ramp_s) {
  StateMachine machine(ramp_s);
  machine.on(Trigger::device_connected);
  machine.on(Trigger::self_test_passed);
  return machine;
}

StateMachine waiting(double ramp_s) {
  StateMachine machine = disarmed(ramp_s);
  machine.on(Trigger::arm);
  return machine;
}

/// Returns a machine that is armed and calm, in the first tick of the ramp.
StateMachine ramping(double ramp_s) {
  StateMachine machine = waiting(ramp_s);
  while (machine.state() == State::waiting) machine.advance(true, kTick_s);
  return machine;
}

StateMachine active(double ramp_s) {
  StateMachine machine = ramping(ramp_s);
  while (machine.state() == State::ramping) machine.advance(true, kTick_s);
  return machine;
}

}  // namespace

TEST_CASE("the machine starts disconnected, then disarmed, and stays so for any hand", "[state_machine]") {
  CHECK(StateMachine(1.0).state() == State::disconnected);
  StateMachine machine = disarmed(1.0);
  for (int i = 0; i < 10'000; ++i) {
    REQUIRE(machine.advance(true, kTick_s) == 0.0);
    REQUIRE(machine.state() == State::disarmed);
  }
}

TEST_CASE("after arming it waits until the hand has been calm for 100 ms", "[state_machine]") {
  StateMachine machine = disarmed(1.0);
  for (int i = 0; i < 1'000; ++i) machine.advance(true, kTick_s);  // calm time before arming does not count
  machine.on(Trigger::arm);
  CHECK(machine.state() == State::waiting);
  for (int i = 1; i < kCalmTicks; ++i) {
    REQUIRE(machine.advance(true, kTick_s) == 0.0);
    REQUIRE(machine.state() == State::waiting);
  }
  CHECK(machine.advance(true, kTick_s) == 0.0);
  CHECK(machine.state() == State::ramping);
}

TEST_CASE("the wait starts again when the hand is not calm", "[state_machine]") {
  StateMachine machine = waiting(1.0);
  for (int round = 0; round < 10; ++round) {
    for (int i = 1; i < kCalmTicks; ++i) machine.advance(true, kTick_s);
    REQUIRE(machine.advance(false, kTick_s) == 0.0);
    REQUIRE(machine.state() == State::waiting);
  }
  CHECK(machine.advance(false, 10.0) == 0.0);
  CHECK(machine.state() == State::waiting);
  for (int i = 1; i < kCalmTicks; ++i) machine.advance(true, kTick_s);
  CHECK(machine.state() == State::waiting);
  machine.advance(true, kTick_s);
  CHECK(machine.state() == State::ramping);
}

TEST_CASE("the ramp rises linearly from 0 to full authority in its duration", "[state_machine]") {
  for (const double ramp_s : {0.125, 1.0, 4.0}) {
    StateMachine machine = ramping(ramp_s);
    const int ticks = static_cast<int>(ramp_s / kTick_s);
    for (int i = 1; i < ticks; ++i) {
      REQUIRE(machine.advance(false, kTick_s) == Approx(i * kTick_s / ramp_s).epsilon(1e-12));
      REQUIRE(machine.state() == State::ramping);
    }
    machine.advance(false, kTick_s);
    REQUIRE(machine.advance(false, kTick_s) == 1.0);
    CHECK(machine.state() == State::active);
  }
}

TEST_CASE("a ramp of zero duration is a step", "[state_machine]") {
  StateMachine machine = waiting(0.0);
  while (machine.state() == State::waiting) REQUIRE(machine.advance(true, kTick_s) == 0.0);
  CHECK(machine.advance(true, kTick_s) == 1.0);
  CHECK(machine.state() == State::active);
}

TEST_CASE("disarming removes the force within 100 ms, without a step", "[state_machine]") {
  StateMachine machine = active(1.0);
  machine.on(Trigger::disarm);
  CHECK(machine.state() == State::releasing);
  double before = machine.authority();
  int ticks = 0;
  for (; machine.state() == State::releasing; ++ticks) {
    const double authority = machine.advance(true, kTick_s);
    CHECK(authority < before);
    CHECK(authority >= before - 10.0 * kTick_s - 1e-12);
    before = authority;
  }
  CHECK(ticks == kCalmTicks);
  CHECK(machine.state() == State::disarmed);
  CHECK(machine.authority() == 0.0);
}

TEST_CASE("an interruption removes all authority immediately and returns to waiting", "[state_machine]") {
  for (StateMachine machine : {ramping(1.0), active(1.0)}) {
    machine.on(Trigger::interrupted);
    CHECK(machine.state() == State::waiting);
    CHECK(machine.advance(true, kTick_s) == 0.0);
    for (int i = 2; i < kCalmTicks; ++i) REQUIRE(machine.advance(true, kTick_s) == 0.0);
    CHECK(machine.state() == State::waiting);
    machine.advance(true, kTick_s);
    CHECK(machine.state() == State::ramping);
  }
}

TEST_CASE("a temporary fault fades the force in 10 ms; recovery has a ramp of its own", "[state_machine]") {
  StateMachine machine = active(1.0);
  CHECK(machine.on(Fault::sample_late));
  CHECK(machine.state() == State::degraded);
  CHECK(machine.cause() == Fault::sample_late);
  double before = 1.0;
  int ticks = 0;
  for (; machine.authority() > 0.0; ++ticks) {
    machine.on(Fault::sample_late);
    const double authority = machine.advance(false, kTick_s);
    CHECK(authority < before);
    before = authority;
  }
  CHECK(ticks == 11);
  int clean = 0;
  for (; machine.state() == State::degraded; ++clean) CHECK(machine.advance(false, kTick_s) == 0.0);
  CHECK(clean >= 50);
  CHECK(clean <= 53);
  CHECK(machine.state() == State::ramping);
  CHECK(machine.cause() == Fault::none);
  int rising = 0;
  for (; machine.state() == State::ramping; ++rising) machine.advance(false, kTick_s);
  CHECK(rising == 256);
  CHECK(machine.state() == State::active);
}

TEST_CASE("a recurring fault keeps the force at zero and latches after half a second", "[state_machine]") {
  StateMachine machine = active(1.0);
  for (int i = 0; machine.overdue() == Fault::none; ++i) {
    REQUIRE(i < 600);
    if (i % 40 == 0) machine.on(Fault::sample_late);
    machine.advance(true, kTick_s);
    REQUIRE(machine.state() == State::degraded);
  }
  CHECK(machine.overdue() == Fault::degraded_too_long);
  machine.on(Fault::degraded_too_long);
  CHECK(machine.state() == State::fault);
  CHECK(machine.overdue() == Fault::none);
}

TEST_CASE("more than five temporary faults in ten seconds latch", "[state_machine]") {
  for (const bool fast : {true, false}) {
    StateMachine machine = active(0.1);
    int times = 0;
    for (; times < 20 && machine.overdue() == Fault::none; ++times) {
      machine.on(Fault::tick_late);
      if (machine.overdue() != Fault::none) continue;
      const int ticks = fast ? 1024 : 2 * 1024 + 100;
      for (int i = 0; i < ticks; ++i) machine.advance(true, kTick_s);
      REQUIRE(machine.state() == State::active);
    }
    CHECK(times == (fast ? 6 : 20));
    CHECK(machine.overdue() == (fast ? Fault::degraded_too_often : Fault::none));
  }
}

TEST_CASE("a latched fault keeps its first cause until an acknowledgement; then the self-test runs",
          "[state_machine]") {
  StateMachine machine = active(1.0);
  CHECK(machine.on(Fault::overspeed));
  CHECK(machine.state() == State::fault);
  CHECK(machine.authority() == 0.0);
  for (std::size_t f = 1; f < kFaultCount; ++f) {
    const auto fault = static_cast<Fault>(f);
    if (fault_row(fault).trigger == Trigger::stop) continue;
    CHECK_FALSE(machine.on(fault));
    REQUIRE(machine.state() == State::fault);
    REQUIRE(machine.cause() == Fault::overspeed);
  }
  for (const Trigger t : {Trigger::arm, Trigger::disarm, Trigger::calm, Trigger::recovered,
                          Trigger::device_connected, Trigger::self_test_passed, Trigger::ramp_done})
    machine.on(t);
  CHECK(machine.state() == State::fault);
  machine.on(Trigger::acknowledge);
  CHECK(machine.state() == State::self_test);
  CHECK(machine.cause() == Fault::none);
}

TEST_CASE("for random triggers: force in four states only, a rise in one only, latches hold",
          "[state_machine]") {
  RandomValues random(20261122);
  StateMachine machine(0.05);
  double before = 0.0;
  int seen[kStateCount] = {};
  for (int i = 0; i < 1'000'000; ++i) {
    const State was = machine.state();
    bool acknowledged = false, ended = false;
    const int events = random.integer(0, 12) == 0 ? random.integer(1, 3) : 0;
    for (int e = 0; e < events; ++e) {
      if (random.integer(0, 1) == 0) {
        machine.on(static_cast<Fault>(random.integer(0, static_cast<int>(kFaultCount) - 1)));
        continue;
      }
      const auto trigger = static_cast<Trigger>(random.integer(0, static_cast<int>(kTriggerCount) - 1));
      acknowledged = acknowledged || trigger == Trigger::acknowledge;
      ended = ended || trigger == Trigger::process_end || trigger == Trigger::quit;
      machine.on(trigger);
    }
    if (events == 0 && machine.state() == State::disarmed) machine.on(Trigger::arm);
    if (events == 0 && machine.state() == State::self_test) machine.on(Trigger::self_test_passed);
    if (events == 0 && !is_driving(machine.state())) {
      machine.on(Trigger::acknowledge);
      acknowledged = true;
      machine.on(Trigger::device_connected);
    }
    if (is_latched(was) && !acknowledged && !ended) REQUIRE(is_latched(machine.state()));
    const State in = machine.state();
    const double authority = machine.advance(random.integer(0, 20) != 0, 1e-3);
    REQUIRE(authority >= 0.0);
    REQUIRE(authority <= 1.0);
    if (authority > before) REQUIRE(in == State::ramping);
    if (authority > 0.0) REQUIRE((is_driving(in) && is_driving(machine.state())));
    before = authority;
    ++seen[static_cast<std::size_t>(machine.state())];
  }
  for (const int times : seen) CHECK(times > 100);
}

}  // namespace wrenchd::test_state_machine
