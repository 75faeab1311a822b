// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/clock.hpp"
#include "core/state.hpp"

// The complete state machine: trigger, states, next state, reaction on the force, and the reason. The program
// runs from this table: core/state_machine.hpp looks up every transition, and `wrenchctl faults` prints it. A
// static_assert checks that each trigger has exactly one row for each state.

namespace wrenchd {

/// Events of the state machine. Each fault (core/fault.hpp) maps to one of them.
enum class Trigger : std::uint8_t {
  device_connected,     ///< an identified device sends reports
  device_disconnected,  ///< the device left the bus
  self_test_passed,     ///< the self-test passed
  self_test_failed,     ///< the self-test failed
  arm,                  ///< a client requests force
  calm,                 ///< the handle was slow and the requested wrench small for kCalmDuration_s
  ramp_done,            ///< authority has reached 1
  disarm,               ///< a client or a fault ends the force
  fade_done,            ///< authority has reached 0
  interrupted,          ///< the proxy is invalid, or the dead man's button was released
  soft_fault,           ///< a fault that may clear by itself
  recovered,            ///< no fault for kRecoveryDuration_s
  hard_fault,           ///< a fault that requires an acknowledgement
  stop,                 ///< emergency stop
  acknowledge,          ///< a user acknowledged a fault or an emergency stop
  quit,                 ///< request to end the process
  process_end,          ///< the process ends now
  info,                 ///< information only; changes nothing
};
inline constexpr std::size_t kTriggerCount = 18;

/// Name of a trigger, for example "device connected". RT-safe.
const char* name(Trigger trigger) noexcept;

/// Reaction on the force, from the mildest to the hardest.
enum class Reaction : std::uint8_t {
  none,
  fade_100ms,  ///< authority falls to zero within 100 ms
  fade_10ms,   ///< authority falls to zero within 10 ms
  zero,        ///< zero wrench in this tick
  release,     ///< zero wrench in this tick; after the zero wrenches of a release nothing is sent
};

/// Name of a reaction, for example "fade 100 ms". RT-safe.
const char* name(Reaction reaction) noexcept;

/// Longest time until the force is zero, without the one tick in which the reaction starts. RT-safe.
constexpr Duration time_to_zero(Reaction reaction) noexcept {
  if (reaction == Reaction::fade_100ms) return std::chrono::milliseconds(100);
  if (reaction == Reaction::fade_10ms) return std::chrono::milliseconds(10);
  return Duration{0};
}

/// A set of states as a bit mask.
using StateSet = std::uint16_t;

template <class... States>
constexpr StateSet make_state_set(States... states) noexcept {
  return static_cast<StateSet>((0U | ... | (1U << static_cast<unsigned>(states))));
}
constexpr bool contains(StateSet set, State state) noexcept {
  return (set >> static_cast<unsigned>(state) & 1U) != 0;
}

/// One row: effect of `trigger` in any of the states `from`. If a fault has a harder reaction, that one
/// applies.
struct Transition {
  Trigger trigger;
  StateSet from;
  bool changes_state;  ///< true: the next state is `to`; false: the state does not change
  State to;
  Reaction reaction;
  const char* reason;
};

/// All rows, ordered by trigger.
std::span<const Transition> transitions() noexcept;

/// Row of a trigger in a state. RT-safe.
const Transition& transition(Trigger trigger, State from) noexcept;

}  // namespace wrenchd
