// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

namespace wrenchd {

/// State of the servo loop. Force is possible in ramping, active, degraded and releasing only. Authority
/// rises in ramping only. core/transitions.hpp defines the transitions.
enum class State : std::uint8_t {
  disconnected,  ///< no device
  self_test,     ///< device present; the self-test checks its reports and its watchdog
  disarmed,      ///< zero wrench, motors off: after every start, reconnection and cleared fault
  waiting,       ///< armed, zero wrench until the hand is slow and the requested wrench is small
  ramping,       ///< authority rises from 0 to 1
  active,        ///< full authority
  degraded,      ///< temporary fault: authority falls to zero and rises again when the fault clears
  releasing,     ///< disarmed on request: authority falls to zero
  fault,         ///< latched fault: zero wrench until an acknowledgement
  stopped,       ///< latched emergency stop: zero wrench until an acknowledgement
  shutdown,      ///< final release
};
inline constexpr std::size_t kStateCount = 11;

/// Name of a state, for example "disarmed". RT-safe.
const char* name(State state) noexcept;

/// True if force is possible in this state.
constexpr bool is_driving(State state) noexcept {
  return state == State::ramping || state == State::active || state == State::degraded ||
         state == State::releasing;
}

/// True if only an acknowledgement leaves this state.
constexpr bool is_latched(State state) noexcept {
  return state == State::fault || state == State::stopped;
}

}  // namespace wrenchd
