// SPDX-License-Identifier: GPL-3.0-or-later
#include <set>

#include <catch2/catch.hpp>

#include "tests/support/expected_machine.hpp"
#include "tests/support/fault_rig.hpp"

// Every fault, in every state, with the hand in the air, in contact and at the limits: found in time,
// answered as safety wants it, and no invariant broken in any tick on the way.

namespace wrenchd::test {
namespace {

/// Until when the force has to be gone, from the tick in which the fault was found.
int ticks_to_zero(const FaultRow& row, State from) {
  const Transition& t = transition(row.trigger, from);
  const Reaction reaction = std::max(t.reaction, t.leads ? row.reaction : Reaction::none);
  return static_cast<int>(time_to_zero(reaction) / std::chrono::milliseconds(1)) +
         (reaction < Reaction::zero ? 1 : 0);
}

/// The force has to go, from that state.
bool takes_force(const FaultRow& row, State from) {
  return row.trigger != Trigger::noted && is_driving(from);
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
  } while (!rig.found(injection.expected));
  const FaultRow& row = fault_row(injection.expected);
  // Others may have come before it, or with it; harder ones decide.
  State wanted = expected_after(row.trigger, before);
  bool harder = false;
  for (const FaultRow& other : fault_rows()) {
    if (other.fault == injection.expected || !rig.found(other.fault)) continue;
    harder = harder || (other.trigger != Trigger::noted && other.trigger != row.trigger);
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
  return rig.broken();
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

}  // namespace
}  // namespace wrenchd::test
