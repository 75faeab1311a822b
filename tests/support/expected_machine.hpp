// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <map>

#include "core/transitions.hpp"

namespace wrenchd::test {

/// The expected state machine: target state by trigger and state. Written by hand from the safety
/// requirements, not from the daemon's table. Pairs that are absent do not change the state.
inline const std::map<Trigger, std::map<State, State>>& expected_machine() {
  static const auto machine = [] {
    using S = State;
    using T = Trigger;
    std::map<Trigger, std::map<State, State>> e;
    e[T::device_connected] = {{S::disconnected, S::self_test}, {S::shutdown, S::self_test}};
    for (const State s :
         {S::self_test, S::disarmed, S::waiting, S::ramping, S::active, S::degraded, S::releasing})
      e[T::device_disconnected][s] = S::disconnected;
    e[T::self_test_passed] = {{S::self_test, S::disarmed}};
    e[T::self_test_failed] = {{S::self_test, S::fault}};
    e[T::arm] = {{S::disarmed, S::waiting}};
    e[T::calm] = {{S::waiting, S::ramping}};
    e[T::ramp_done] = {{S::ramping, S::active}};
    e[T::disarm] = {{S::waiting, S::disarmed},
                    {S::ramping, S::releasing},
                    {S::active, S::releasing},
                    {S::degraded, S::releasing}};
    e[T::fade_done] = {{S::releasing, S::disarmed}};
    for (const State s : {S::waiting, S::ramping, S::active, S::degraded}) e[T::interrupted][s] = S::waiting;
    e[T::soft_fault] = {{S::waiting, S::waiting},
                        {S::ramping, S::degraded},
                        {S::active, S::degraded},
                        {S::degraded, S::degraded}};
    e[T::recovered] = {{S::degraded, S::ramping}};
    for (const State s :
         {S::self_test, S::disarmed, S::waiting, S::ramping, S::active, S::degraded, S::releasing})
      e[T::hard_fault][s] = S::fault;
    for (const State s : {S::disconnected, S::self_test, S::disarmed, S::waiting, S::ramping, S::active,
                          S::degraded, S::releasing, S::fault})
      e[T::stop][s] = S::stopped;
    e[T::acknowledge] = {{S::fault, S::self_test}, {S::stopped, S::self_test}};
    for (const State s : {S::disconnected, S::self_test, S::disarmed, S::waiting, S::fault, S::stopped})
      e[T::quit][s] = S::shutdown;
    for (const State s : {S::ramping, S::active, S::degraded}) e[T::quit][s] = S::releasing;
    for (std::size_t s = 0; s < kStateCount; ++s) e[T::process_end][static_cast<State>(s)] = S::shutdown;
    return e;
  }();
  return machine;
}

/// Returns true if the trigger changes the state.
inline bool transition_expected(Trigger trigger, State from) {
  const auto known = expected_machine().find(trigger);
  return known != expected_machine().end() && known->second.count(from) > 0;
}

inline State expected_after(Trigger trigger, State from) {
  return transition_expected(trigger, from) ? expected_machine().at(trigger).at(from) : from;
}

}  // namespace wrenchd::test
