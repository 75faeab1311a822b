// SPDX-License-Identifier: GPL-3.0-or-later
#include <set>

#include <catch2/catch.hpp>

#include "tests/support/expected_machine.hpp"
#include "tests/support/fault_rig.hpp"

// Every fault, in every state, with the hand in the air, in contact and at the limits: found in time,
// answered as the safety requirements (tests/support/expected_machine.hpp) state, and no invariant broken in
// any tick on the way.

namespace wrenchd::test {
namespace {

/// Until when the force has to be gone, from the tick in which the fault was found.
int ticks_to_zero(const FaultRow& row, State from) {
  const Transition& t = transition(row.trigger, from);
  const Reaction reaction = std::max(t.reaction, t.changes_state ? row.reaction : Reaction::none);
  return static_cast<int>(time_to_zero(reaction) / std::chrono::milliseconds(1)) +
         (reaction < Reaction::zero ? 1 : 0);
}

/// The force has to go, from that state.
bool takes_force(const FaultRow& row, State from) {
  return row.trigger != Trigger::info && is_driving(from);
}

std::string run(const Injection& injection, State state, Phase phase) {
  FaultRig rig(phase);
  if (!rig.bring_to(state)) return std::string("does not come to ") + name(state);
  injection.begin(rig);
  State before = rig.state();
  int tick = 0;
  do {
    before = rig.state();
    if (++tick > injection.within_ticks) return "not found in time";
    rig.tick();
    if (injection.each_tick) injection.each_tick(rig);
  } while (!rig.raised(injection.expected));
  const FaultRow& row = fault_row(injection.expected);
  // Others may have come before it, or with it; harder ones decide.
  State wanted = expected_after(row.trigger, before);
  bool harder = false;
  for (const FaultRow& other : fault_rows()) {
    if (other.fault == injection.expected || !rig.raised(other.fault)) continue;
    harder = harder || (other.trigger != Trigger::info && other.trigger != row.trigger);
  }
  if (wanted == State::releasing && rig.state() == State::disarmed && rig.force_N() == 0.0)
    wanted = State::disarmed;
  if (!harder && rig.state() != wanted)
    return std::string("leads from ") + name(before) + " to " + name(rig.state()) + ", not to " +
           name(wanted);
  if (row.trigger == Trigger::hard_fault && is_latched(wanted) && !is_latched(rig.state()))
    return "is not latched";
  if (takes_force(row, before)) {
    for (int i = 0; i < ticks_to_zero(row, before); ++i) rig.tick();
    const bool back = rig.state() == State::ramping || rig.state() == State::active;
    if (rig.force_N() != 0.0 && !back) return "force after the deadline: " + std::to_string(rig.force_N());
  }
  return rig.violation();
}

TEST_CASE("every fault in every state and phase is found in time and answered as it should be", "[faults]") {
  int combinations = 0;
  std::set<Fault> faults;
  for (const Injection& injection : injections())
    for (const State state : rig_states())
      for (const Phase phase : {Phase::free, Phase::contact, Phase::saturated}) {
        if (!injection.applies(state, phase)) continue;
        const std::string wrong = run(injection, state, phase);
        INFO(injection.name << ", " << name(state) << ", " << name(phase) << ": " << wrong);
        CHECK(wrong.empty());
        ++combinations;
        faults.insert(injection.expected);
      }
  WARN(combinations << " combinations of " << injections().size() << " injections, " << faults.size()
                    << " faults");
  CHECK(combinations >= 500);
  CHECK(faults.size() >= 30);
}

// Those that take a plan of their own.

TEST_CASE("motors that are warm give less, and say so", "[faults]") {
  FaultRig rig(Phase::contact, [](RunConfig& plan) {
    plan.profile.continuous_force_N = 0.5;
    plan.profile.continuous_torque_Nm = 0.2;
    plan.profile.thermal_time_s = 4.0;
  });
  REQUIRE(rig.bring_to(State::active));
  CHECK(rig.force_N() > 1.0);
  int ticks = 0;
  for (; ticks < 4000 && !rig.raised(Fault::overheated); ++ticks) rig.tick();
  CHECK(ticks < 2000);
  for (int i = 0; i < 2000; ++i) rig.tick();
  CHECK(rig.force_N() < 0.51);
  CHECK(rig.state() == State::active);
  CHECK((rig.last().limit_causes & kForceThermal) != 0);
  CHECK(rig.violation() == "");
}

TEST_CASE("a contact that buzzes loses half its stiffness, twice, and then the force", "[faults]") {
  FaultRig rig(Phase::contact);
  REQUIRE(rig.bring_to(State::active));
  rig.inject(SimulatedFault::Kind::vibrate, 2.0, 0.0005);
  double share = rig.last().stiffness_scale;
  for (const int time : {1, 2}) {
    int ticks = 0;
    for (; ticks < 200 && !rig.raised(Fault::oscillating); ++ticks) rig.tick();
    INFO("time " << time << " after " << ticks << " ticks");
    CHECK(ticks <= 55);
    CHECK(rig.last().stiffness_scale == Approx(0.5 * share));
    CHECK(rig.state() == State::active);
    share = rig.last().stiffness_scale;
    rig.tick();
  }
  for (int i = 0; i < 200 && rig.state() == State::active; ++i) rig.tick();
  CHECK(rig.state() == State::fault);
  CHECK(rig.raised(Fault::oscillation_persists));
  CHECK(rig.force_N() == 0.0);
  CHECK(rig.violation() == "");
}

TEST_CASE("energy from nowhere, more than the guard can take back, is a fault", "[faults]") {
  // A wall far beyond what the device bears, at the limit of force; then the handle is said to be farther
  // out, along the force, than the spring had been pressed.
  FaultRig rig(Phase::contact, [](RunConfig& plan) {
    plan.settings.servo.self_test_s = 0.0;
    plan.settings.wrench.energy_stiffness_per_s2 *= 20.0;
    plan.settings.wrench.gains.damping.setZero();
    plan.settings.limits.max_force_N = 10.0;
    plan.settings.simulation.hand_stiffness_N_per_m = 3000.0;
  });
  REQUIRE(rig.bring_to(State::active));
  CHECK(rig.force_N() > 5.0);
  double out_m = 0.0;
  rig.faulty_device.corrupt = [&out_m](DeviceSample& s) { s.X_BH.translation_m.z() += out_m; };
  int ticks = 0;
  for (; ticks < 20 && !rig.raised(Fault::energy_generated); ++ticks) {
    out_m += 0.004;
    rig.tick();
  }
  CHECK(ticks < 10);
  CHECK(rig.raised(Fault::energy_generated));
  CHECK(rig.state() == State::fault);
  CHECK(rig.violation() == "");
}

TEST_CASE("a proxy without an admissible pose is a fault after three ticks", "[faults]") {
  FaultRig rig(Phase::free, [](RunConfig& plan) {
    for (const double side : {1.0, -1.0})  // the cube is 50 mm wide
      plan.scene.half_spaces.push_back({"wall", {side, 0.0, 0.0}, -0.02});
  });
  rig.proxy_initializer->override_pose = true;
  rig.proxy_initializer->overriding_pose.translation_m.z() = 0.06;
  int ticks = 0;
  for (; ticks < 100 && !rig.raised(Fault::projection_failed); ++ticks) rig.tick();
  CHECK(ticks < 20);
  CHECK(rig.raised(Fault::projection_failed));
  rig.loop.requests().arm();
  for (int i = 0; i < 500; ++i) {
    rig.tick();
    REQUIRE(rig.force_N() == 0.0);
  }
  CHECK(rig.violation() == "");
}

}  // namespace
}  // namespace wrenchd::test
