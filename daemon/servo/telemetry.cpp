// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/telemetry.hpp"

#include <algorithm>
#include <limits>

namespace wrenchd {
namespace {

/// A wait this long is reported.
constexpr Duration kLongWait = std::chrono::seconds(1);

constexpr double kNotSet = std::numeric_limits<double>::quiet_NaN();

std::array<double, 6> numbers(const Vector3d& a, const Vector3d& b) noexcept {
  return {a.x(), a.y(), a.z(), b.x(), b.y(), b.z()};
}

std::int64_t nanoseconds(TimePoint t) noexcept {
  return t.time_since_epoch().count();
}

void record_sample(const DeviceReading& reading, TickRecord& record) noexcept {
  const DeviceSample& sample = reading.sample;
  record.last_command_sent = reading.last_command_sent;
  record.arrived_ns = nanoseconds(sample.arrived);
  record.device_time_s = sample.device_time_s;
  record.sequence = sample.sequence;
  record.acknowledged_command = sample.acknowledged;
  record.superseded = sample.superseded;
  record.missing = sample.missing;
  record.rejected = sample.rejected;
  record.repeated = sample.repeated;
  record.buttons = sample.buttons;
  record.fresh = sample.fresh ? 1 : 0;
  record.motors_on = sample.motors_on ? 1 : 0;
  record.watchdog_tripped = sample.watchdog_tripped ? 1 : 0;
  record.homed = sample.homed ? 1 : 0;
  record.sample_fault = sample.fault;
  record.X_BH = numbers_of(sample.X_BH);
  record.V_BH = numbers(sample.V_BH.linear_m_per_s, sample.V_BH.angular_rad_per_s);
  record.estimated_velocity_dofs = sample.estimated_velocity_dofs;
}

void record_external_request(const Requests& asked, TickRecord& record) noexcept {
  if (!asked.external_wrench) return;
  const ExternalWrenchRequest& request = *asked.external_wrench;
  record.requested_external = numbers(request.F_H_W.force_N, request.F_H_W.torque_Nm);
  record.external_energy_J = request.energy_J;
  record.external_expires_ns = nanoseconds(request.expires);
}

void record_contact(const ContactState& contact, TickRecord& record) noexcept {
  record.X_WP = numbers_of(contact.X_WP);
  record.X_WQ.fill(kNotSet);
  if (contact.proxy_valid) record.X_WQ = numbers_of(contact.X_WQ);
  record.X_WB.fill(0.0);
  for (std::size_t i = 0; i < contact.X_WB.size(); ++i) {
    const PoseNumbers X = numbers_of(contact.X_WB[i]);
    std::copy(X.begin(), X.end(), record.X_WB.begin() + static_cast<std::ptrdiff_t>(X.size() * i));
  }
  record.eps.fill(kNotSet);
  record.energy = record.kkt_residual = kNotSet;
  if (contact.following()) {
    record.eps = numbers(contact.eps.head<3>(), contact.eps.tail<3>());
    record.energy = contact.energy;
    record.kkt_residual = contact.kkt_residual;
  }
  record.contacts = contact.contacts;
  record.iterations = contact.iterations;
  record.projection_status = static_cast<std::uint8_t>(contact.status);
  record.proxy_initialization = static_cast<std::uint8_t>(contact.initialization);
  record.undriven_lag_rad = contact.undriven_lag_rad;
  record.undriven_account_J = contact.undriven_account_J;
  record.rendering_id = contact.rendering_id;
  record.rendering_checksum = contact.rendering_checksum;
}

void record_demand(const Demand& demand, TickRecord& record) noexcept {
  record_contact(demand.contact, record);
  record.F_T = numbers(demand.F_T.force_N, demand.F_T.torque_Nm);
  record.next_rendering_weight = demand.next_rendering_weight;
  record.contact_gain = demand.contact_gain;
  record.undriven_dofs = demand.undriven;
}

void record_state(const Supervisor& supervisor, TickRecord& record) noexcept {
  record.state = static_cast<std::uint8_t>(supervisor.state());
  record.state_cause = supervisor.cause();
  record.faults = supervisor.faults();
}

void record_output(const TickResult& tick, TickRecord& record) noexcept {
  const PassivityGuard& guard = tick.stabilizer.guard();
  record.authority = tick.authority.scale;
  record.stiffness_scale = tick.stabilizer.oscillation_gain() * tick.stiffness_scale.spring;
  record.passivity_scale = guard.scale();
  record.energy_in_J = guard.energy_in_J();
  record.energy_out_J = guard.energy_out_J();
  record.injected_J = guard.injected_J();
  record.limit_causes = tick.limit_causes;
  record.F_external = numbers(tick.external.F.force_N, tick.external.F.torque_Nm);
  record.external_balance_J = tick.external.balance_J;
  record.F_out = numbers(tick.written.F.force_N, tick.written.F.torque_Nm);
  record.motors_commanded = tick.written.sent && tick.written.motors_on ? 1 : 0;
  record.write_fault = tick.written.result;
  record.released = tick.released ? 1 : 0;
}

TickRecord make_record(const TickResult& tick, const Supervisor& supervisor) noexcept {
  TickRecord record;
  record.tick = tick.time.tick;
  record.now_ns = nanoseconds(tick.time.now);
  record.wake_latency_ns = tick.time.wake_latency.count();
  record.suspended_ns = tick.time.suspended.count();
  record.wrench_ready_ns = nanoseconds(tick.wrench_ready);
  record.stage_ns = tick.stage_ns;
  record.commands = tick.asked.commands;
  record.change_count = tick.change_count;
  record_sample(tick.reading, record);
  record_external_request(tick.asked, record);
  record_demand(tick.demand, record);
  record_state(supervisor, record);
  record_output(tick, record);
  return record;
}

}  // namespace

void Telemetry::publish(const TickResult& tick, const Supervisor& supervisor,
                        const Rendering& rendering) noexcept {
  record_ = make_record(tick, supervisor);
  totals_.add(record_);
  emit_changes(supervisor, tick.time.now);
  if (!tick.released) emit_proxy_changes(tick.demand, tick.time.now);
  show_wait(supervisor.state(),
            wrenchd::wait_reason(supervisor.state(), supervisor.faults(), tick.reading.sample, tick.demand,
                                 tick.time.now),
            tick.time.now);
  if (tick.released) events_.emit(tick.time.now, Event::Released{});
  const ContactState& contact = tick.demand.contact;
  if (tick.demand.sample_usable)
    handle_pose_.write({contact.X_WH, contact.X_WB, tick.time.scene_time_s, tick.time.now});
  show(rendering, contact.crossfading);
}

void Telemetry::publish_release(TimePoint now, const Supervisor& supervisor, const Demand& demand,
                                const Rendering& rendering) noexcept {
  record_.commands = static_cast<CommandSet>(record_.commands | kReleasedExternally);
  record_.released = 1;
  record_.motors_commanded = 0;
  record_.authority = 0.0;
  record_.limit_causes = kNotLimited;
  record_.F_out = record_.F_external = {};
  record_.external_balance_J = 0.0;
  record_demand(demand, record_);
  record_state(supervisor, record_);
  emit_changes(supervisor, now);
  show_wait(supervisor.state(), {}, now);
  events_.emit(now, Event::Released{});
  show(rendering, demand.contact.crossfading);
}

void Telemetry::show(const Rendering& rendering, bool crossfading) noexcept {
  state_.store(static_cast<State>(record_.state), std::memory_order_relaxed);
  cause_.store(record_.state_cause, std::memory_order_relaxed);
  rendering_id_.store(record_.rendering_id, std::memory_order_relaxed);
  crossfading_.store(crossfading, std::memory_order_relaxed);
  latest_record_.write(record_);
  if (shared_state_ != nullptr) shared_state_->write(record_, rendering.contacts());
}

void Telemetry::emit_changes(const Supervisor& supervisor, TimePoint now) noexcept {
  if (supervisor.state() != reported_state_)
    events_.emit(now, Event::StateChanged{supervisor.state(), supervisor.cause()});
  reported_state_ = supervisor.state();
}

/// Each change once: the search starts, it ends, it fails, the projection is infeasible. A released hand has
/// no search.
void Telemetry::emit_proxy_changes(const Demand& demand, TimePoint now) noexcept {
  const ContactState& contact = demand.contact;
  if (demand.proxy_invalidated) reported_search_failed_ = false;
  if (contact.proxy_valid && !reported_proxy_valid_)
    events_.emit(now, Event::ProxyFound{(contact.X_WQ.translation_m - contact.X_WP.translation_m).norm()});
  if (!contact.proxy_valid && reported_proxy_valid_) events_.emit(now, Event::ProxySearchStarted{});
  reported_proxy_valid_ = contact.proxy_valid;
  const bool failed = contact.initialization == ProxyInitialization::failed;
  if (failed && !reported_search_failed_) events_.emit(now, Event::ProxySearchFailed{});
  reported_search_failed_ = reported_search_failed_ || failed;
  if (!contact.following()) return;
  if (contact.infeasible() && reported_status_ != ProjectionStatus::infeasible)
    events_.emit(now, Event::ProjectionInfeasible{});
  reported_status_ = contact.status;
}

/// A wait is reported after a second, because a hand that comes to rest sooner needs no advice. Each
/// condition that keeps the force away is reported once in a wait, at least a second after the one before.
void Telemetry::show_wait(State state, const WaitReason& reason, TimePoint now) noexcept {
  show(reason);
  const bool waited = waiting_;
  waiting_ = state == State::waiting || state == State::self_test;
  if (!waiting_ || !waited) {
    wait_reported_ = now;
    reported_waits_ = 0;
    return;
  }
  const unsigned kind = 1U << static_cast<unsigned>(reason.kind);
  if (reason.kind == WaitReason::Kind::none || (reported_waits_ & kind) != 0 ||
      now - wait_reported_ < kLongWait)
    return;
  wait_reported_ = now;
  reported_waits_ |= kind;
  events_.emit(now, Event::Waits{state, reason});
}

void Telemetry::show(const WaitReason& reason) noexcept {
  const std::array<double, 6> numbers = {reason.value,           reason.limit,
                                         reason.to_proxy_W_m[0], reason.to_proxy_W_m[1],
                                         reason.to_proxy_W_m[2], reason.to_proxy_rad};
  for (std::size_t i = 0; i < numbers.size(); ++i)
    wait_numbers_[i].store(numbers[i], std::memory_order_relaxed);
  wait_fault_.store(reason.fault, std::memory_order_relaxed);
  wait_kind_.store(reason.kind, std::memory_order_relaxed);
}

WaitReason Telemetry::wait_reason() const noexcept {
  const auto number = [this](std::size_t i) { return wait_numbers_[i].load(std::memory_order_relaxed); };
  WaitReason reason;
  reason.kind = wait_kind_.load(std::memory_order_relaxed);
  reason.fault = wait_fault_.load(std::memory_order_relaxed);
  reason.value = number(0);
  reason.limit = number(1);
  reason.to_proxy_W_m = {number(2), number(3), number(4)};
  reason.to_proxy_rad = number(5);
  return reason;
}

void Telemetry::count_times(const TickTime& time, const StageTimes& stage_ns, Duration elapsed) noexcept {
  for (std::size_t i = 0; i < kStageCount; ++i) timing_.stage[i].add(Duration(stage_ns[i]));
  timing_.wake_latency.add(time.wake_latency);
  timing_.tick.add(elapsed);
}

void Telemetry::show_limits(const LimitSettings& limits) noexcept {
  const std::array<double, 5> values = {limits.max_force_N, limits.max_torque_Nm, limits.force_slew_N_per_s,
                                        limits.torque_slew_Nm_per_s, limits.soft_start_s};
  for (std::size_t i = 0; i < values.size(); ++i) limits_[i].store(values[i], std::memory_order_relaxed);
}

LimitSettings Telemetry::limits() const noexcept {
  const auto value = [this](std::size_t i) { return limits_[i].load(std::memory_order_relaxed); };
  return {value(0), value(1), value(2), value(3), value(4)};
}

void Telemetry::count_overrun(std::uint64_t skipped_ticks) noexcept {
  timing_.overruns.fetch_add(1, std::memory_order_relaxed);
  timing_.skipped_ticks.fetch_add(skipped_ticks, std::memory_order_relaxed);
}

}  // namespace wrenchd
