// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/state_machine.hpp"

#include <algorithm>
#include <limits>

namespace wrenchd {

const Transition& StateMachine::on(Trigger trigger, Reaction at_least) noexcept {
  const Transition& row = transition(trigger, state_);
  if (row.leads) enter(row.to);
  if (row.leads || row.reaction != Reaction::none) react(std::max(row.reaction, at_least));
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

/// A state entered again from itself begins anew.
void StateMachine::enter(State to) noexcept {
  const State from = state_;
  state_ = to;
  quiet_s_ = 0.0;
  if (to == from) return;
  in_state_s_ = 0.0;
  fall_per_s_ = 0.0;
  if (to == State::ramping) {
    const double over_s = from == State::degraded ? std::min(kComeBackOver_s, ramp_s_) : ramp_s_;
    steps_up_ = !(over_s > 0.0);
    rise_per_s_ = steps_up_ ? 0.0 : 1.0 / over_s;
  }
  if (to == State::degraded) {
    const double longest_ago_s = degraded_ago_s_[next_ago_];
    too_often_ = longest_ago_s > 0.0 && longest_ago_s < kDegradedWithin_s;
    degraded_ago_s_[next_ago_] = std::numeric_limits<double>::min();  // now, and not never
    next_ago_ = (next_ago_ + 1) % degraded_ago_s_.size();
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
  for (double& ago_s : degraded_ago_s_)
    if (ago_s > 0.0) ago_s += dt;
  in_state_s_ += dt;
  quiet_s_ += dt;
  authority_ = std::max(authority_ - fall_per_s_ * dt, 0.0);
  if (state_ == State::ramping) {
    authority_ = steps_up_ ? 1.0 : std::min(authority_ + rise_per_s_ * dt, 1.0);
    if (authority_ >= 1.0) on(Trigger::ramped);
  } else if (state_ == State::waiting) {
    if (!calm) quiet_s_ = 0.0;
    if (quiet_s_ >= kCalmFor_s) on(Trigger::calm);
  } else if (state_ == State::degraded) {
    if (quiet_s_ >= kCleanFor_s && authority_ <= 0.0) on(Trigger::clean);
  } else if (state_ == State::releasing && authority_ <= 0.0) {
    on(Trigger::faded);
  }
  return authority_;
}

Fault StateMachine::overdue() const noexcept {
  if (state_ != State::degraded) return Fault::none;
  if (too_often_) return Fault::degraded_too_often;
  return in_state_s_ > kDegradedFor_s ? Fault::degraded_too_long : Fault::none;
}

}  // namespace wrenchd
