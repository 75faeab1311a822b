// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/clock.hpp"
#include "core/state.hpp"

// The whole machine on one page: what happens (Trigger), in which states, where it leads, what the hand feels
// (Reaction), and why. The table is what runs: core/state_machine.hpp looks everything up in it, `wrenchctl
// faults` prints it. Each trigger has exactly one row for each state, which is checked when this is compiled.

namespace wrenchd {

/// What can happen. Faults (core/fault.hpp) come as one of these.
enum class Trigger : std::uint8_t {
  device_connected,     ///< reports come from a device that was identified
  device_disconnected,  ///< it left the bus
  self_test_passed,     ///< the self-test
  self_test_failed,     ///< the self-test
  arm,                  ///< somebody asks for force
  calm,                 ///< the hand was slow, and would not have been pushed, for a moment
  ramp_done,            ///< authority has reached 1
  disarm,               ///< somebody, or a fault, wants no more force
  fade_done,            ///< authority has reached 0
  interrupted,          ///< the proxy has lost its place, or the hand let go of the dead man's button
  soft_fault,           ///< something that may pass by itself
  recovered,            ///< nothing was wrong for a while
  hard_fault,           ///< something that somebody has to look at
  stop,                 ///< emergency stop
  acknowledge,          ///< somebody has looked
  quit,                 ///< the process is asked to end
  process_end,          ///< the process ends now
  info,                 ///< something worth knowing that changes nothing
};
inline constexpr std::size_t kTriggerCount = 18;

/// "device there"
const char* name(Trigger trigger) noexcept;

/// What becomes of the force on the hand, from the mildest to the hardest.
enum class Reaction : std::uint8_t {
  none,
  fade_100ms,  ///< authority to zero within 100 ms
  fade_10ms,   ///< within 10 ms
  zero,        ///< in this tick
  release,     ///< in this tick, and nothing is sent any more after the zeros of a release
};

/// "fade 100 ms"
const char* name(Reaction reaction) noexcept;

/// How long it may take until the hand is free: the time of the fade, and one tick.
constexpr Duration time_to_zero(Reaction reaction) noexcept {
  if (reaction == Reaction::fade_100ms) return std::chrono::milliseconds(100);
  if (reaction == Reaction::fade_10ms) return std::chrono::milliseconds(10);
  return Duration{0};
}

/// A set of states, as bits.
using StateSet = std::uint16_t;

template <class... States>
constexpr StateSet make_state_set(States... states) noexcept {
  return static_cast<StateSet>((0U | ... | (1U << static_cast<unsigned>(states))));
}
constexpr bool contains(StateSet set, State state) noexcept {
  return (set >> static_cast<unsigned>(state) & 1U) != 0;
}

/// One row: what `trigger` does in any of the states `from`. A fault that comes with a harder reaction of its
/// own has that one.
struct Transition {
  Trigger trigger;
  StateSet from;
  bool changes_state;  ///< to `to`; else the state stays as it is
  State to;
  Reaction reaction;
  const char* reason;
};

/// All rows, by trigger.
std::span<const Transition> transitions() noexcept;

/// The row for a trigger in a state: there is one for each. RT safe.
const Transition& transition(Trigger trigger, State from) noexcept;

}  // namespace wrenchd
