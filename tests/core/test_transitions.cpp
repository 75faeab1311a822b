// SPDX-License-Identifier: GPL-3.0-or-later
#include <set>
#include <string>

#include <catch2/catch.hpp>

#include "core/fault.hpp"
#include "tests/support/expected_machine.hpp"

namespace wrenchd::test_transitions {

using namespace wrenchd::test;

namespace {

State after(Trigger trigger, State from) {
  const Transition& row = transition(trigger, from);
  return row.changes_state ? row.to : from;
}

}  // namespace

TEST_CASE("every trigger in every state leads to the state of the safety requirements", "[transitions]") {
  int pairs = 0;
  for (std::size_t t = 0; t < kTriggerCount; ++t)
    for (std::size_t s = 0; s < kStateCount; ++s, ++pairs) {
      const auto trigger = static_cast<Trigger>(t);
      const auto from = static_cast<State>(s);
      INFO(name(trigger) << " in " << name(from));
      const Transition& row = transition(trigger, from);
      CHECK(row.trigger == trigger);
      CHECK(contains(row.from, from));
      CHECK(row.changes_state == transition_expected(trigger, from));
      CHECK(after(trigger, from) == expected_after(trigger, from));
      CHECK(std::string(row.reason).size() > 5);
    }
  CHECK(pairs == 18 * 11);
}

TEST_CASE("no transition adds force; those that leave a driving state remove it at once or by a fade",
          "[transitions]") {
  for (const Transition& row : transitions())
    for (std::size_t s = 0; s < kStateCount; ++s) {
      const auto from = static_cast<State>(s);
      if (!contains(row.from, from) || !row.changes_state || !is_driving(from)) continue;
      INFO(name(row.trigger) << " in " << name(from));
      if (!is_driving(row.to)) CHECK(row.reaction >= Reaction::zero);
      if (row.to == State::degraded || row.to == State::releasing)
        CHECK(row.reaction >= Reaction::fade_100ms);
      if (row.to == State::ramping) CHECK(row.trigger == Trigger::recovered);
      if (row.to == State::active) CHECK(row.trigger == Trigger::ramp_done);
    }
}

TEST_CASE("only an acknowledgement or the end of the process leaves a latched state", "[transitions]") {
  for (std::size_t t = 0; t < kTriggerCount; ++t)
    for (const State from : {State::fault, State::stopped}) {
      const auto trigger = static_cast<Trigger>(t);
      const bool opens =
          trigger == Trigger::acknowledge || trigger == Trigger::quit || trigger == Trigger::process_end;
      INFO(name(trigger) << " in " << name(from));
      CHECK(is_latched(after(trigger, from)) == !opens);
    }
}

TEST_CASE("only one path leads to full force: self-test, arm, calm, ramp", "[transitions]") {
  const auto leading_to = [](State to) {
    std::set<std::pair<State, Trigger>> ways;
    for (std::size_t t = 0; t < kTriggerCount; ++t)
      for (std::size_t s = 0; s < kStateCount; ++s) {
        const auto from = static_cast<State>(s);
        if (from != to && after(static_cast<Trigger>(t), from) == to)
          ways.insert({from, static_cast<Trigger>(t)});
      }
    return ways;
  };
  using Ways = std::set<std::pair<State, Trigger>>;
  CHECK(leading_to(State::active) == Ways{{State::ramping, Trigger::ramp_done}});
  CHECK(leading_to(State::ramping) ==
        Ways{{State::waiting, Trigger::calm}, {State::degraded, Trigger::recovered}});
  CHECK(leading_to(State::self_test) == Ways{{State::disconnected, Trigger::device_connected},
                                             {State::shutdown, Trigger::device_connected},
                                             {State::fault, Trigger::acknowledge},
                                             {State::stopped, Trigger::acknowledge}});
}

TEST_CASE("every state can be entered and left", "[transitions]") {
  std::set<State> reached = {State::disconnected};
  for (std::size_t round = 0; round < kStateCount; ++round)
    for (const State from : std::set<State>(reached))
      for (std::size_t t = 0; t < kTriggerCount; ++t) reached.insert(after(static_cast<Trigger>(t), from));
  CHECK(reached.size() == kStateCount);
}

}  // namespace wrenchd::test_transitions
