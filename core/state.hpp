// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

namespace wrenchd {

/// Where the servo loop stands. Force can be on the hand in ramping, active, degraded and releasing, and in
/// no other state; authority rises in ramping alone. core/transitions.hpp says what leads from one to the
/// next.
enum class State : std::uint8_t {
  disconnected,  ///< no device
  self_test,     ///< it is there, and has to show that it reports as it should and frees the hand by itself
  disarmed,      ///< zero wrench, motors off: after every start, replug and cleared fault
  waiting,       ///< armed, but the hand is fast or would be pushed: zero wrench until it is calm
  ramping,       ///< authority rises from 0 to 1
  active,        ///< full authority
  degraded,      ///< a fault that may pass: authority falls to zero, and comes back when it has passed
  releasing,     ///< disarmed on purpose: authority falls to zero
  fault,         ///< latched: zero wrench until somebody acknowledges
  stopped,       ///< emergency stop, latched likewise
  shutdown,      ///< the hand was released for the last time
};
inline constexpr std::size_t kStateCount = 11;

/// "disarmed"
const char* name(State state) noexcept;

/// Whether force can be on the hand.
constexpr bool is_driving(State state) noexcept {
  return state == State::ramping || state == State::active || state == State::degraded ||
         state == State::releasing;
}

/// Whether somebody has to acknowledge before anything else can happen.
constexpr bool is_latched(State state) noexcept {
  return state == State::fault || state == State::stopped;
}

}  // namespace wrenchd
