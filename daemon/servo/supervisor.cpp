// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/supervisor.hpp"

#include <bit>

#include "core/finite.hpp"
#include "core/watch_limits.hpp"

namespace wrenchd {
namespace {

/// A proxy that found no admissible pose may find one in the next tick, from a slightly different place.
constexpr int kMaxInfeasibleTicks = 3;

bool is_usable(const DeviceSample& sample) noexcept {
  return sample.fresh && sample.fault == Fault::none && is_finite(sample.X_BH) && is_finite(sample.V_BH);
}

}  // namespace

Supervisor::Supervisor(const Settings& settings, const DeviceProfile& profile, double max_force_N,
                       double max_torque_Nm, EventQueue& events)
    : events_(events),
      has_motors_(driven_dofs(profile) != kNoDof),
      watches_(profile, max_force_N, max_torque_Nm),
      self_test_(profile, settings.servo.self_test_s),
      machine_(settings.limits.soft_start_s) {}

Verdict Supervisor::judge(const DeviceSample& sample, CommandSet commands, const Written& last_write,
                          bool proxy_valid, const TickTime& t) noexcept {
  previous_faults_ = faults_;
  faults_ = 0;
  changed_by_ = Fault::none;
  Verdict verdict;
  verdict.sample_usable = is_usable(sample);

  raise(t.faults, t.now, seconds(t.lateness));
  raise(last_write.faults, t.now);
  if (is_driving(machine_.state()))
    raise(watches_.motor_stall.check(last_write.F, sample.X_BH, t.now), t.now);
  if (sample.fault != Fault::device_lost &&
      transition(Trigger::device_connected, machine_.state()).changes_state)
    machine_.on(Trigger::device_connected);
  if ((commands & kHeartbeat) != 0) watches_.client.heartbeat(t.now);
  if ((commands & kClientLost) != 0) watches_.client.client_lost();
  const bool driven = last_write.motors_on && !testing_ && has_motors_;
  raise(watches_.check(sample, machine_.state(), driven, t), t.now);
  if (const Fault overdue = machine_.overdue(); overdue != Fault::none) raise(overdue, t.now);

  run_self_test(sample, verdict, t);
  apply_commands(commands, proxy_valid, verdict, t);
  verdict.state = machine_.state();
  verdict.release = (faults_ & bit(Fault::device_lost)) != 0 || verdict.state == State::shutdown;
  return verdict;
}

void Supervisor::run_self_test(const DeviceSample& sample, Verdict& verdict, const TickTime& t) noexcept {
  verdict.self_test_started = !testing_ && machine_.state() == State::self_test;
  testing_ = machine_.state() == State::self_test;
  if (!testing_) return;
  if (verdict.self_test_started) self_test_.start(t.now);
  raise(self_test_.check(sample, faults_, t.now), t.now, self_test_.report_rate_Hz());
  if (self_test_.passed()) {
    machine_.on(Trigger::self_test_passed);
    verdict.self_test_passed = self_test_.report_rate_Hz() > 0.0;
  }
  testing_ = machine_.state() == State::self_test;
}

/// The safest command first: stop and arm in one tick stop. Arming invalidates the proxy, because a hand that
/// had no force on it may have moved through walls while the proxy stayed behind.
void Supervisor::apply_commands(CommandSet commands, bool proxy_valid, Verdict& verdict,
                                const TickTime& t) noexcept {
  if ((commands & kStop) != 0) raise(Fault::stop_requested, t.now);
  if ((commands & kOtherHandReleased) != 0) raise(Fault::other_hand_released, t.now);
  if ((commands & kAcknowledge) != 0 && (commands & kStop) == 0) machine_.on(Trigger::acknowledge);
  if ((commands & kQuit) != 0) machine_.on(Trigger::quit);
  if ((commands & kDisarm) != 0) machine_.on(Trigger::disarm);
  verdict.invalidate_proxy = (commands & kReinitialize) != 0;
  if (verdict.invalidate_proxy) machine_.on(Trigger::interrupted);
  if ((commands & kArm) == 0 || (commands & (kStop | kDisarm | kQuit | kClientLost)) != 0) return;
  if (!transition(Trigger::arm, machine_.state()).changes_state)
    return events_.emit(t.now, Event::ArmingRejected{machine_.state()});
  if (proxy_valid && !verdict.invalidate_proxy) {
    verdict.invalidate_proxy = true;
    machine_.on(Trigger::interrupted);
  }
  machine_.on(Trigger::arm);
  if ((commands & kLease) == 0) return;
  watches_.client.start(t.now);
  if ((commands & kHeartbeat) != 0) watches_.client.heartbeat(t.now);
}

bool Supervisor::projection_failed(const Demand& demand) const noexcept {
  return demand.sample_usable && demand.contact.infeasible() && infeasible_ticks_ + 1 >= kMaxInfeasibleTicks;
}

bool Supervisor::wrench_late(const Demand& demand, const DeviceSample& sample,
                             TimePoint ready) const noexcept {
  return demand.sample_usable && ready - sample.arrived > kLateAnswer &&
         (faults_ & bit(Fault::sample_late)) == 0;
}

State Supervisor::preview(const Demand& demand, const DeviceSample& sample, TimePoint ready,
                          const TickTime& t) const noexcept {
  StateMachine next = machine_;
  if (demand.interrupted) next.on(Trigger::interrupted);
  if (projection_failed(demand)) next.on(Fault::projection_failed);
  if (wrench_late(demand, sample, ready)) next.on(Fault::wrench_late);
  next.advance(demand.calm.holds(), t.dt_s);
  return next.state();
}

Authority Supervisor::authorise(const Demand& demand, const Stabilized& contact, bool overheated,
                                const DeviceSample& sample, TimePoint ready, const TickTime& t) noexcept {
  if (demand.interrupted) machine_.on(Trigger::interrupted);
  if (projection_failed(demand)) raise(Fault::projection_failed, t.now);
  if (demand.sample_usable) infeasible_ticks_ = demand.contact.infeasible() ? infeasible_ticks_ + 1 : 0;
  if (wrench_late(demand, sample, ready)) raise(Fault::wrench_late, t.now, seconds(ready - sample.arrived));
  machine_.advance(demand.calm.holds(), t.dt_s);
  raise(contact.faults, t.now);

  Authority authority;
  authority.scale = machine_.authority();
  if (overheated) raise(Fault::overheated, t.now);
  if (!is_finite(contact.F + demand.F_weight)) {
    raise(Fault::wrench_not_finite, t.now);
    authority.scale = 0.0;
  }
  authority.state = machine_.state();
  const bool testing = authority.state == State::self_test;
  authority.send = !testing || self_test_.sends_commands();
  authority.motors_on = testing ? self_test_.motors_on() : is_driving(authority.state);
  // In releasing the force fades already: the client may leave without a fault.
  const bool armed = is_driving(authority.state) && authority.state != State::releasing;
  if (!armed && authority.state != State::waiting) watches_.client.stop();
  return authority;
}

void Supervisor::forget_device() noexcept {
  watches_.reset();
  watches_.client.stop();
}

void Supervisor::set_limits(const LimitSettings& limits) noexcept {
  watches_.motor_stall = MotorStallWatch(limits.max_force_N, limits.max_torque_Nm);
  machine_.set_ramp_s(limits.soft_start_s);
}

void Supervisor::raise(FaultSet faults, TimePoint now, double value) noexcept {
  for (; faults != 0; faults &= faults - 1) raise(first_fault(faults), now, value);
}

/// The log gets a fault that lasts once, and again if it changes the state.
void Supervisor::raise(Fault fault, TimePoint now, double value) noexcept {
  if (fault == Fault::none) return;
  const bool changed = machine_.on(fault);
  if (changed) changed_by_ = fault;
  if (changed || (previous_faults_ & bit(fault)) == 0)
    events_.emit(now, Event::FaultRaised{fault, value, changed});
  faults_ |= bit(fault);
}

}  // namespace wrenchd
