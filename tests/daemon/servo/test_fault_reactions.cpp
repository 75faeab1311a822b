// SPDX-License-Identifier: GPL-3.0-or-later
#include <set>

#include <catch2/catch.hpp>

#include "tests/support/expected_machine.hpp"
#include "tests/support/fault_rig.hpp"

namespace wrenchd::test_fault_reactions {

using namespace test;

// Every fault, in every state, with the hand in the air, in contact and at the limits. The loop raises the
// fault in time and reacts as the safety requirements (tests/support/expected_machine.hpp) state. No tick
// breaks an invariant.

namespace {

/// Returns the number of ticks after which the force must be zero, from the tick that raises the fault.
int ticks_to_zero(const FaultRow& row, State from) {
  const Transition& t = transition(row.trigger, from);
  const Reaction reaction = std::max(t.reaction, t.changes_state ? row.reaction : Reaction::none);
  return static_cast<int>(time_to_zero(reaction) / std::chrono::milliseconds(1)) +
         (reaction < Reaction::zero ? 1 : 0);
}

/// Returns true if the fault must remove the force in this state.
bool removes_force(const FaultRow& row, State from) {
  return row.trigger != Trigger::info && is_driving(from);
}

std::string run(const Injection& injection, State state, Phase phase) {
  FaultRig rig(phase);
  if (!rig.bring_to(state)) return std::string("does not reach the state ") + name(state);
  injection.begin(rig);
  State before = rig.state();
  int tick = 0;
  do {
    before = rig.state();
    if (++tick > injection.within_ticks) return "not raised in time";
    rig.tick();
    if (injection.each_tick) injection.each_tick(rig);
  } while (!rig.raised(injection.expected));
  const FaultRow& row = fault_row(injection.expected);
  // Other faults may be raised before this one or in the same tick. The most severe fault decides the state.
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
  if (removes_force(row, before)) {
    for (int i = 0; i < ticks_to_zero(row, before); ++i) rig.tick();
    const bool back = rig.state() == State::ramping || rig.state() == State::active;
    if (rig.force_N() != 0.0 && !back) return "force after the deadline: " + std::to_string(rig.force_N());
  }
  return rig.violation();
}

TEST_CASE("every fault is raised in time in every state and phase, with the required reaction", "[faults]") {
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

// Faults that require a configuration of their own.

TEST_CASE("warm motors lower the force limit, and the loop reports it", "[faults]") {
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

TEST_CASE("an oscillating contact halves the stiffness twice, and then sets the force to zero", "[faults]") {
  FaultRig rig(Phase::contact);
  REQUIRE(rig.bring_to(State::active));
  rig.inject(SimulatedFault::Kind::vibrate, 2.0, 0.0005);
  double scale = rig.last().stiffness_scale;
  for (const int time : {1, 2}) {
    int ticks = 0;
    for (; ticks < 200 && !rig.raised(Fault::oscillating); ++ticks) rig.tick();
    INFO("time " << time << " after " << ticks << " ticks");
    CHECK(ticks <= 55);
    CHECK(rig.last().stiffness_scale == Approx(0.5 * scale));
    CHECK(rig.state() == State::active);
    scale = rig.last().stiffness_scale;
    rig.tick();
  }
  for (int i = 0; i < 200 && rig.state() == State::active; ++i) rig.tick();
  CHECK(rig.state() == State::fault);
  CHECK(rig.raised(Fault::oscillation_persists));
  CHECK(rig.force_N() == 0.0);
  CHECK(rig.violation() == "");
}

TEST_CASE("generated energy beyond what the guard can remove is a fault", "[faults]") {
  // The wall is stiffer than the stability bound allows, and the force is at its limit. Then the samples
  // report the handle farther out, along the force, than the compression of the spring.
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
}  // namespace wrenchd::test_fault_reactions
