// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

#include "core/fault.hpp"
#include "core/transitions.hpp"

namespace wrenchd {

/// What "calm" means: slow enough that no push can surprise, and the push itself small.
inline constexpr double kCalmSpeed_m_per_s = 0.05;
inline constexpr double kCalmAngularSpeed_rad_per_s = 0.5;
inline constexpr double kCalmLimitFraction = 0.10;
inline constexpr double kCalmDuration_s = 0.100;

/// A degraded loop comes back after so long without a fault, over so long a rise; it may not stay so for
/// longer, nor become so more often than that.
inline constexpr double kRecoveryDuration_s = 0.050;
inline constexpr double kRecoveryRamp_s = 0.250;
inline constexpr double kMaxDegraded_s = 0.500;
inline constexpr int kMaxDegradedEntries = 5;
inline constexpr double kDegradedWindow_s = 10.0;

/// The state of the loop in time, and the authority that follows from it: the share of the wrench asked for
/// that may go out, 0 to 1. It rises in State::ramping only, and is 0 in every state without force. Follows
/// the table of core/transitions.hpp and nothing else. No clock, no I/O. RT safe.
class StateMachine {
 public:
  /// ramp_s: of the rise after arming.
  explicit StateMachine(double ramp_s) noexcept : ramp_s_(ramp_s) {}

  /// Another rise from here on; one that is under way goes on as it began. RT safe.
  void set_ramp_s(double ramp_s) noexcept { ramp_s_ = ramp_s; }

  /// Something happened: the state and the force become what its row says. Returns the row. at_least: the
  /// reaction that comes with a fault, where it is harder than the row's.
  const Transition& on(Trigger trigger, Reaction at_least = Reaction::none) noexcept;
  /// The fault happened. True where it changed the state.
  bool on(Fault fault) noexcept;

  /// One tick further, after all that happened in it. calm: the handle is slow, and the wrench that full
  /// authority would give is small. Returns the authority for this tick.
  double advance(bool calm, double dt_s) noexcept;

  /// That the state has lasted for too long, or came too often; Fault::none else. For the loop to find.
  Fault overdue() const noexcept;

  State state() const noexcept { return state_; }
  double authority() const noexcept { return authority_; }
  /// Why the state is what it is: the fault that led to degraded, releasing, fault or stopped.
  Fault cause() const noexcept { return cause_; }

 private:
  void enter(State to) noexcept;
  void react(Reaction reaction) noexcept;

  double ramp_s_;
  State state_ = State::disconnected;
  Fault cause_ = Fault::none;
  double authority_ = 0.0;
  double rise_per_s_ = 0.0;     ///< in ramping
  bool instant_ramp_ = false;   ///< a ramp of no length
  double fall_per_s_ = 0.0;     ///< while a reaction goes on
  double undisturbed_s_ = 0.0;  ///< for how long it has been calm, or clean
  double in_state_s_ = 0.0;
  std::array<double, kMaxDegradedEntries>
      degraded_entry_age_s_{};  ///< how long ago the last entries were, a ring
  std::size_t next_entry_ = 0;
  bool degraded_too_often_ = false;
};

}  // namespace wrenchd
