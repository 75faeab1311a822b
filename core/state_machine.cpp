// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/state_machine.hpp"

#include <algorithm>
#include <limits>

namespace wrenchd {

const Transition& StateMachine::on(Trigger trigger, Reaction at_least) noexcept {
  const Transition& row = transition(trigger, state_);
  if (row.changes_state) enter(row.to);
  if (row.changes_state || row.reaction != Reaction::none) react(std::max(row.reaction, at_least));
  return row;
}

bool StateMachine::on(Fault fault) noexcept {
  const FaultRow& row = fault_row(fault);
  const State before = state_;
  on(row.trigger, row.reaction);
  if (state_ == before) return false;
  cause_ = fault;
  return true;
}

/// Enters a state. Re-entry of the current state resets only the undisturbed time.
void StateMachine::enter(State to) noexcept {
  const State from = state_;
  state_ = to;
  undisturbed_s_ = 0.0;
  if (to == from) return;
  in_state_s_ = 0.0;
  fall_per_s_ = 0.0;
  if (to == State::ramping) {
    const double over_s = from == State::degraded ? std::min(kRecoveryRamp_s, ramp_s_) : ramp_s_;
    instant_ramp_ = !(over_s > 0.0);
    rise_per_s_ = instant_ramp_ ? 0.0 : 1.0 / over_s;
  }
  if (to == State::degraded) {
    const double longest_ago_s = degraded_entry_age_s_[next_entry_];
    degraded_too_often_ = longest_ago_s > 0.0 && longest_ago_s < kDegradedWindow_s;
    // the smallest positive number means "now"; 0 means "never"
    degraded_entry_age_s_[next_entry_] = std::numeric_limits<double>::min();
    next_entry_ = (next_entry_ + 1) % degraded_entry_age_s_.size();
  }
  if (to == State::self_test || to == State::waiting || to == State::ramping) cause_ = Fault::none;
}

void StateMachine::react(Reaction reaction) noexcept {
  if (reaction >= Reaction::zero) authority_ = 0.0;
  const Duration fade = time_to_zero(reaction);
  if (fade > Duration{0}) fall_per_s_ = std::max(fall_per_s_, 1.0 / seconds(fade));
}

double StateMachine::advance(bool calm, double dt_s) noexcept {
  const double dt = std::max(dt_s, 0.0);
  for (double& ago_s : degraded_entry_age_s_)
    if (ago_s > 0.0) ago_s += dt;
  in_state_s_ += dt;
  undisturbed_s_ += dt;
  authority_ = std::max(authority_ - fall_per_s_ * dt, 0.0);
  if (state_ == State::ramping) {
    authority_ = instant_ramp_ ? 1.0 : std::min(authority_ + rise_per_s_ * dt, 1.0);
    if (authority_ >= 1.0) on(Trigger::ramp_done);
  } else if (state_ == State::waiting) {
    if (!calm) undisturbed_s_ = 0.0;
    if (undisturbed_s_ >= kCalmDuration_s) on(Trigger::calm);
  } else if (state_ == State::degraded) {
    if (undisturbed_s_ >= kRecoveryDuration_s && authority_ <= 0.0) on(Trigger::recovered);
  } else if (state_ == State::releasing && authority_ <= 0.0) {
    on(Trigger::fade_done);
  }
  return authority_;
}

Fault StateMachine::overdue() const noexcept {
  if (state_ != State::degraded) return Fault::none;
  if (degraded_too_often_) return Fault::degraded_too_often;
  return in_state_s_ > kMaxDegraded_s ? Fault::degraded_too_long : Fault::none;
}

}  // namespace wrenchd
