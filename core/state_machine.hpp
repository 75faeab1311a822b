// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

#include "core/fault.hpp"
#include "core/transitions.hpp"

namespace wrenchd {

/// Limits of the calm condition in State::waiting: a slow handle and a small requested wrench.
inline constexpr double kCalmSpeed_m_per_s = 0.05;
inline constexpr double kCalmAngularSpeed_rad_per_s = 0.5;
inline constexpr double kCalmLimitFraction = 0.10;
inline constexpr double kCalmDuration_s = 0.100;

/// State::degraded: time without a fault before recovery, duration of the ramp after it, longest duration of
/// the state, and largest number of entries in a time window.
inline constexpr double kRecoveryDuration_s = 0.050;
inline constexpr double kRecoveryRamp_s = 0.250;
inline constexpr double kMaxDegraded_s = 0.500;
inline constexpr int kMaxDegradedEntries = 5;
inline constexpr double kDegradedWindow_s = 10.0;

/// State of the servo loop and authority, the factor from 0 to 1 on the requested wrench. Authority rises in
/// State::ramping only and is 0 in every state without force. All transitions are in core/transitions.hpp.
/// All members are RT-safe.
class StateMachine {
 public:
  /// ramp_s: duration of the ramp after arming.
  explicit StateMachine(double ramp_s) noexcept : ramp_s_(ramp_s) {}

  /// Sets the duration of the next ramp. A running ramp keeps its duration.
  void set_ramp_s(double ramp_s) noexcept { ramp_s_ = ramp_s; }

  /// Applies a trigger: changes state and authority as the transition table states. Returns the row.
  /// at_least: minimum reaction, from a fault; the harder of it and the row's reaction applies.
  const Transition& on(Trigger trigger, Reaction at_least = Reaction::none) noexcept;
  /// Applies the trigger of a fault. Returns true if it changed the state.
  bool on(Fault fault) noexcept;

  /// Advances time by one tick, after all triggers of the tick. calm: the handle is slow, and the wrench at
  /// full authority would be small. Returns the authority for this tick.
  double advance(bool calm, double dt_s) noexcept;

  /// Fault::degraded_too_long or Fault::degraded_too_often if the limit is exceeded, otherwise Fault::none.
  /// The caller raises the fault.
  Fault overdue() const noexcept;

  State state() const noexcept { return state_; }
  double authority() const noexcept { return authority_; }
  /// The fault that led to the current state degraded, releasing, fault or stopped; Fault::none in other
  /// states.
  Fault cause() const noexcept { return cause_; }

 private:
  void enter(State to) noexcept;
  void react(Reaction reaction) noexcept;

  double ramp_s_;
  State state_ = State::disconnected;
  Fault cause_ = Fault::none;
  double authority_ = 0.0;
  double rise_per_s_ = 0.0;    ///< rate of the ramp in State::ramping
  bool instant_ramp_ = false;  ///< ramp of zero duration
  double fall_per_s_ = 0.0;    ///< rate at which the current reaction reduces authority
  /// time for which the condition of the state, calm or free of faults, has held
  double undisturbed_s_ = 0.0;
  double in_state_s_ = 0.0;
  std::array<double, kMaxDegradedEntries>
      degraded_entry_age_s_{};  ///< time since the last entries into State::degraded, as a ring; 0: never
  std::size_t next_entry_ = 0;
  bool degraded_too_often_ = false;
};

}  // namespace wrenchd
