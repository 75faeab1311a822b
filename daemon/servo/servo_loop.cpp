// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/servo_loop.hpp"

#include <bit>
#include <limits>

#include "core/finite.hpp"
#include "core/watch_limits.hpp"

// What wrenchd does, a thousand times a second or more (Algorithm 1 of the paper):
//
//   device -> pose p -> contacts -> projection q -> wrench -> limits -> device
//
// tick() is that line. Above it is run(), which waits for the next tick and lets nobody out without a
// release; below it are the stages, in order. What is wrong, and what was asked for, is looked at as soon as
// the sample is there, and becomes a state by the table of core/transitions.hpp; the state says how much of
// the wrench goes out.

namespace wrenchd {
namespace {

/// A proxy that found no admissible pose may find one in the next tick, from a little farther on.
constexpr int kFailures = 3;

/// How fast the wrench of the contact goes away, and comes back, for what happens to the workspace [s].
constexpr double kShutOver_s = 0.050;
constexpr double kOpenOver_s = 0.100;

constexpr double kNotSet = std::numeric_limits<double>::quiet_NaN();

Pose pose_of(const PoseSettings& placement) noexcept {
  return {rotation_from(placement.rotation_vector_rad), placement.position_m};
}

std::array<double, 7> numbers(const Pose& X) noexcept {
  const auto& [q, p] = X;
  return {p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w()};
}

std::array<double, 6> numbers(const Vector3d& a, const Vector3d& b) noexcept {
  return {a.x(), a.y(), a.z(), b.x(), b.y(), b.z()};
}

}  // namespace

ServoLoop::ServoLoop(const Settings& settings, const DeviceProfile& profile, Device& device,
                     std::unique_ptr<Rendering> rendering, const Clock& clock)
    : profile_(profile),
      device_(device),
      clock_(clock),
      wrench_point_(profile.wrench_point),
      driven_(driven_dofs(profile)),
      pacing_(settings.servo.pacing),
      period_(from_seconds(1.0 / settings.servo.rate_Hz)),
      renderings_(std::move(rendering)),
      workspace_(pose_of(settings.device.base_in_world)),
      gravity_(profile.masses, pose_of(settings.device.base_in_world).rotation),
      limit_settings_(settings.limits),
      limits_(settings.limits, profile),
      heat_(profile, limits_.max_force_N(), limits_.max_torque_Nm()),
      steady_(settings, profile, felt().stability()),
      watches_(settings, profile, limits_.max_force_N(), limits_.max_torque_Nm()),
      self_test_(profile, settings.servo.self_test_s),
      machine_(settings.limits.soft_start_s) {
  lose_place();
}

ServoLoop::ServoLoop(const Settings& settings, const DeviceProfile& profile, Device& device,
                     const Scene& scene, ProxyInitializer& placer, const Clock& clock)
    : ServoLoop(settings, profile, device,
                std::make_unique<Rendering>(
                    0, settings, profile, std::shared_ptr<const Scene>(std::shared_ptr<void>(), &scene),
                    std::shared_ptr<ProxyInitializer>(std::shared_ptr<void>(), &placer)),
                clock) {}

Fault ServoLoop::run(Clock& clock, const std::atomic<bool>& stop) noexcept {
  TimePoint due = clock.now();
  while (machine_.state() != State::shutdown || !stop.load(std::memory_order_relaxed)) {
    if (stop.load(std::memory_order_relaxed)) request(kQuit);
    due = wait_for_next(clock, due);
    if (tick(clock.now(), due) == Fault::device_lost) return Fault::device_lost;  // the hand was let go
  }
  return Fault::none;
}

Fault ServoLoop::tick(TimePoint now, TimePoint due) noexcept {
  begin(now, due);

  const DeviceSample sample = device_.read_newest(now);  // the pose the hand gives
  record_sample(sample);
  lap(Stage::read);

  look(sample, now);  // what is wrong, what was asked for, and the state that follows
  take_changes(now);  // another scene, workspace, limit, made ready outside
  if ((found_ & bit(Fault::device_lost)) != 0 || machine_.state() == State::shutdown) {
    let_go(now);
    return (found_ & bit(Fault::device_lost)) != 0 ? Fault::device_lost : changed_by_;
  }

  if (good_) project(sample);  // contacts, and the closest admissible configuration q
  lap(Stage::projection);

  if (good_) compute_wrench(sample);  // Eq. (16) or the energy law, from p to q
  check_answer(sample, now);
  lap(Stage::wrench);

  Limited out = limit(sample, now);  // passivity, soft start, magnitude, slew, power
  lap(Stage::limits);

  send(now, out);
  heat_.advance(out.F, dt_s_);
  steady_.update_measurement(sample, record_.last_command_sent, now);
  lap(Stage::write);
  if ((found_ & bit(Fault::device_lost)) != 0) {
    let_go(now);
    return Fault::device_lost;
  }
  finish(now, out);
  return changed_by_;
}

void ServoLoop::release(TimePoint now) noexcept {
  machine_.on(Trigger::process_end);
  record_.commands = static_cast<CommandSet>(record_.commands | kReleasedExternally);
  let_go(now);
}

/// The one way out, whatever led to it: zero wrench, motors off, and nothing is known of what comes next.
void ServoLoop::let_go(TimePoint now) noexcept {
  device_.release(now);
  motors_told_ = false;
  record_.motors_commanded = 0;
  record_.authority = 0.0;
  limits_.reset();
  renderings_.reset_law();
  sampled_ = false;  // what comes next may be a device that was plugged in anew, with another clock
  watches_.reset();
  watches_.client.stop();
  say_changes(now);
  say(Event::Kind::released, now);
  record_.released = 1;
  describe(Limited{});
  publish();
}

/// Sleeps until the next tick is due, by the clock or by the device's next report. A loop that fell behind
/// leaves out the ticks it missed: two ticks in a row on old news would help nobody.
TimePoint ServoLoop::wait_for_next(Clock& clock, TimePoint due) noexcept {
  if (pacing_ == Pacing::device) {
    device_.wait_readable(clock.now() + kDeviceTimeout_periods * period_);
    return clock.now();
  }
  TimePoint next = due + period_;
  const TimePoint now = clock.now();
  if (now > next) {
    const auto missed = (now - next) / period_ + 1;
    timing_.overruns.fetch_add(1, std::memory_order_relaxed);
    timing_.skipped_ticks.fetch_add(static_cast<std::uint64_t>(missed), std::memory_order_relaxed);
    next += missed * period_;
  }
  clock.sleep_until(next);
  return next;
}

/// Starts the tick's record, and looks at the time.
void ServoLoop::begin(TimePoint now, TimePoint due) noexcept {
  tick_start_ = lap_start_ = clock_.now();
  const std::uint64_t tick = record_.tick + (ticked_ ? 1 : 0);
  record_ = TickRecord{};
  record_.tick = tick;
  record_.now_ns = now.time_since_epoch().count();
  record_.wake_latency_ns = (now - due).count();
  record_.commands = commands_.exchange(kNoCommand, std::memory_order_relaxed);
  const Duration slept = clock_.time_suspended();
  record_.suspended_ns = slept.count();
  record_.last_command_sent = device_.commands_sent();
  found_before_ = found_;
  found_ = 0;
  changed_by_ = Fault::none;
  if (!ticked_) first_tick_ = now;
  ticked_ = true;
  now_ = now;
  scene_time_s_ = seconds(now - first_tick_);
  const FaultSet pace = watches_.pace.check(now, slept);
  found(pace, now, seconds(watches_.pace.lateness()));
  dt_s_ = watches_.pace.dt_s();
}

/// What is wrong, then what was asked for, so that nobody can arm what is not in order.
void ServoLoop::look(const DeviceSample& sample, TimePoint now) noexcept {
  const bool there = sample.fault != Fault::device_lost;
  if (there && transition(Trigger::device_connected, machine_.state()).changes_state)
    machine_.on(Trigger::device_connected);
  if ((record_.commands & kHeartbeat) != 0) watches_.client.heartbeat(now);
  if ((record_.commands & kClientLost) != 0) watches_.client.client_lost();
  found(watches_.check(sample, machine_.state(), motors_told_ && !testing_ && driven_ != kNoDof, now), now);
  good_ = sample.fresh && sample.fault == Fault::none && is_finite(sample.X_BH) && is_finite(sample.V_BH);
  if (const Fault overdue = machine_.overdue(); overdue != Fault::none) found(overdue, now);
  test(sample, now);
  obey(record_.commands, now);
  heed_buttons(sample.buttons);
}

void ServoLoop::test(const DeviceSample& sample, TimePoint now) noexcept {
  const bool begins = !testing_;
  testing_ = machine_.state() == State::self_test;
  if (!testing_) return;
  if (begins) {
    self_test_.start(now);
    steady_.start_measurement();
  }
  found(self_test_.check(sample, found_, now), now, self_test_.report_rate_Hz());
  if (self_test_.passed()) {
    machine_.on(Trigger::self_test_passed);
    if (self_test_.report_rate_Hz() > 0.0) settle_stiffness(now);
  }
  testing_ = machine_.state() == State::self_test;
}

/// The safest first: who stops and arms at once has stopped. A hand that felt nothing may have gone through
/// walls while the proxy stayed behind, so arming starts over.
void ServoLoop::obey(CommandSet commands, TimePoint now) noexcept {
  if ((commands & kStop) != 0) found(Fault::stop_requested, now);
  if ((commands & kAcknowledge) != 0 && (commands & kStop) == 0) machine_.on(Trigger::acknowledge);
  if ((commands & kQuit) != 0) machine_.on(Trigger::quit);
  if ((commands & kDisarm) != 0) machine_.on(Trigger::disarm);
  if ((commands & kReinitialize) != 0) lose_place();
  if ((commands & kArm) == 0 || (commands & (kStop | kDisarm | kQuit | kClientLost)) != 0) return;
  if (!transition(Trigger::arm, machine_.state()).changes_state)
    return say(Event::Kind::arming_refused, now, static_cast<std::uint32_t>(machine_.state()));
  if (felt().proxy_valid()) lose_place();
  machine_.on(Trigger::arm);
  if ((commands & kLease) == 0) return;
  watches_.client.start(now);
  if ((commands & kHeartbeat) != 0) watches_.client.heartbeat(now);
}

/// The recentre button. A device without motors has leapt back already, and nothing has to fade.
void ServoLoop::heed_buttons(std::uint32_t buttons) noexcept {
  const bool recentre = (buttons & ~buttons_ & button_bit(profile_.recentre_button)) != 0;
  buttons_ = buttons;
  if (!recentre) return;
  if (driven_ != kNoDof) {
    recentres_ = shut_ = true;
    return;
  }
  workspace_.recentre();
  lose_place();
}

void ServoLoop::found(FaultSet faults, TimePoint now, double value) noexcept {
  for (; faults != 0; faults &= faults - 1) found(static_cast<Fault>(std::countr_zero(faults)), now, value);
}

void ServoLoop::found(Fault fault, TimePoint now, double value) noexcept {
  if (fault == Fault::none) return;
  const bool changed = machine_.on(fault);
  if (changed) changed_by_ = fault;
  if (changed || (found_before_ & bit(fault)) == 0)
    say(Event::Kind::fault_raised, now, static_cast<std::uint32_t>(fault), value);
  found_ |= bit(fault);
}

/// Nothing is known of q: no contact, zero wrench, and the soft start waits.
void ServoLoop::lose_place() noexcept {
  if (renderings_.invalidate_proxy()) change_rendering();
  said_nowhere_ = false;
  F_out_ = F_weight_ = Wrench{};
  dropped_ = kNoDof;
  limits_.reset();
  machine_.on(Trigger::interrupted);
}

/// What was made ready outside, between two ticks. What the hand feels of another scene, or of another
/// workspace, changes over many ticks; where there is no force it may change at once.
void ServoLoop::take_changes(TimePoint now) noexcept {
  const bool force = is_driving(machine_.state());
  switch (renderings_.update(force)) {
    case RenderingCrossfade::Change::none:
      break;
    case RenderingCrossfade::Change::next_arrived:
      scale_renderings();
      say(Event::Kind::crossfade_started, now, renderings_.next()->id());
      ++changes_;
      break;
    case RenderingCrossfade::Change::switched:
      change_rendering();
      if (!force || !felt().proxy_valid()) lose_place();
  }
  if (WorkspaceRequest wish; wishes_.read(wish)) change_workspace(wish);
  if (LocalModelSet models; new_models_.read(models)) {
    ++changes_;
    models_.set_models(models);
    models_share_ = steady_.max_stable_scale(models_.total_gains());
  }
  if (LimitSettings asked; new_limits_.read(asked)) change_limits(asked);
}

/// What is felt is another rendering.
void ServoLoop::change_rendering() noexcept {
  steady_.set_stability(felt().stability());
  scale_renderings();
  say(Event::Kind::rendering_changed, now_, felt().id());
  ++changes_;
}

/// Each as stiff as the device bears.
void ServoLoop::scale_renderings() noexcept {
  renderings_.active().set_stiffness_scale(steady_.stiffness_scale());
  if (Rendering* next = renderings_.next())
    next->set_stiffness_scale(steady_.max_stable_scale(next->stability()));
}

/// Where the tool stands is taken from the proxy when the clutch lets it go on: it touches, and does not
/// press.
void ServoLoop::change_workspace(const WorkspaceRequest& wish) noexcept {
  ++changes_;
  workspace_.set_scale(wish.scale);
  if (wish.clutched && !workspace_.clutched()) workspace_.engage_clutch();
  if (!wish.clutched && workspace_.clutched())
    workspace_.disengage_clutch(felt().proxy_valid() ? felt().X_WQ() * inverse(felt().X_HT())
                                                     : workspace_.X_WH());
  recentres_ = recentres_ || wish.recentre_count != recentred_;
  recentred_ = wish.recentre_count;
  shut_ = wish.clutched || recentres_;
}

/// What is looser is left out while anything can go out.
void ServoLoop::change_limits(LimitSettings asked) noexcept {
  ++changes_;
  const bool armed = is_driving(machine_.state()) || machine_.state() == State::waiting;
  if (armed) asked = tighter(limit_settings_, asked, profile_);
  limit_settings_ = asked;
  limits_.set_limits(asked, profile_);
  heat_.set_maxima(limits_.max_force_N(), limits_.max_torque_Nm());
  watches_.motor_stall = MotorStallWatch(limits_.max_force_N(), limits_.max_torque_Nm());
  machine_.set_ramp_s(asked.soft_start_s);
}

/// What clients know of the surroundings of the handle, in the axes of the base.
Wrench ServoLoop::feel_local_models(const DeviceSample& sample) noexcept {
  if (wrench_point_ == WrenchPoint::world_origin) return {};
  modelled_ =
      models_.evaluate(workspace_.X_WH(), workspace_.twist_in_world(sample.V_BH), now_, dt_s_, models_share_);
  steady_.credit(modelled_.crossfade_work_J);
  return modelled_.any_active ? workspace_.wrench_on_hand(modelled_.F_H_W) : Wrench{};
}

/// How much of the contact's wrench the hand feels: nothing of a tool that stands apart from it.
void ServoLoop::let_through() noexcept {
  const double last = through_;
  if (shut_) through_ = std::max(through_ - dt_s_ / kShutOver_s, 0.0);
  if (!shut_) through_ = std::min(through_ + dt_s_ / kOpenOver_s, 1.0);
  steady_.credit((through_ - last) * renderings_.stored_energy_J() + last * renderings_.crossfade_work_J());
  steady_.credit_obstacle_work(last * renderings_.obstacle_work_J());
  if (!recentres_ || through_ > 0.0) return;
  recentres_ = false;
  shut_ = workspace_.clutched();
  workspace_.recentre();
  lose_place();
}

/// Lines 2 to 6: p from the sample, and its projection q, which follows the hand from last tick's as a proxy.
/// One that is caught between obstacles that move has lost its place.
void ServoLoop::project(const DeviceSample& sample) noexcept {
  const Pose X_WH = workspace_.update(sample.X_BH, dt_s_);
  if (steady_.set_workspace_scale(workspace_.scale())) scale_renderings();
  if (!renderings_.project(X_WH, now_, scene_time_s_)) lose_place();
  device_.set_proxy_pose(held());
  whereabouts_.write({X_WH, scene_time_s_, now_});
}

/// Where the world holds the handle, in the base.
std::optional<Pose> ServoLoop::held() const noexcept {
  if (felt().proxy_initialization() != ProxyInitialization::complete || workspace_.clutched()) return {};
  return workspace_.pose_in_base(felt().X_WQ() * inverse(felt().X_HT()));
}

/// Line 7: the body wrench, and the same wrench as the device wants it. The law runs on the device's clock,
/// which knows when the poses were taken. Without a q there is no contact. What the device has no motors for
/// is dropped here, and told.
void ServoLoop::compute_wrench(const DeviceSample& sample) noexcept {
  const double dt_s = sampled_ ? sample.device_time_s - sample_time_s_ : 0.0;
  sample_time_s_ = sample.device_time_s;
  sampled_ = true;
  renderings_.compute_wrench(dt_s);
  Wrench F = outgoing(felt());
  if (const Rendering* next = renderings_.next())
    F = renderings_.blend(F, outgoing(*next),
                          {limits_.max_force_N(), limits_.max_torque_Nm(), limit_settings_.soft_start_s},
                          dt_s_);
  let_through();
  const Wrench F_weight = gravity_.wrench(sample.X_BH);
  F = through_ * F + feel_local_models(sample);
  dropped_ = static_cast<DofMask>(nonzero_dofs(F + F_weight) & ~driven_);
  F_out_ = restrict_to_dofs(F, driven_);
  F_weight_ = restrict_to_dofs(F_weight, driven_);
}

/// About the handle point in the axes of the device base, or the paper's spatial wrench W_S: as the profile
/// says.
Wrench ServoLoop::outgoing(const Rendering& rendering) const noexcept {
  if (wrench_point_ == WrenchPoint::world_origin) return spatial_wrench(rendering.X_WP(), rendering.F_T());
  const Wrench F_H_W = wrench_about(workspace_.X_WH().translation_m, rendering.X_WP(), rendering.F_T());
  return workspace_.wrench_on_hand(F_H_W);
}

/// Whether what was computed may be used: in time, and from an admissible pose.
void ServoLoop::check_answer(const DeviceSample& sample, TimePoint now) noexcept {
  const TimePoint answered = clock_.now();
  record_.wrench_ready_ns = answered.time_since_epoch().count();
  if (!good_) return;
  const bool failed = felt().proxy_initialization() == ProxyInitialization::complete &&
                      felt().depth().projection.status == ProjectionStatus::infeasible;
  failures_ = failed ? failures_ + 1 : 0;
  if (failures_ >= kFailures) found(Fault::projection_failed, now);
  const Duration age = answered - sample.arrived;
  if (age > kLateAnswer && (found_ & bit(Fault::sample_late)) == 0)
    found(Fault::wrench_late, now, seconds(age));
}

/// Line 8, before it goes out: what the hand may feel of the wrench now, with the handle's weight held. The
/// weight is no push, so it does not make the hand wait for calm.
Limited ServoLoop::limit(const DeviceSample& sample, TimePoint now) noexcept {
  machine_.advance(calm(sample), dt_s_);
  const Wrench F = steady_.stabilize(F_out_, sample,
                                     {machine_.state(), good_, renderings_.in_contact() && through_ > 0.0,
                                      through_ * renderings_.stored_energy_J()});
  found(steady_.faults(), now);  // which may end the force in this very tick
  record_.authority = machine_.authority();
  limits_.set_ceiling(heat_.force_ceiling_N(), heat_.torque_ceiling_Nm());
  if (is_finite(sample.X_BH) && is_finite(sample.V_BH)) {
    hand_m_ = sample.X_BH.translation_m;
    V_hand_ = sample.V_BH;
  }
  Limited out = limits_.apply({F + F_weight_, record_.authority, dt_s_, V_hand_, hand_m_});
  if (steady_.guard_intervened()) out.causes |= kPassivity;
  if (heat_.folded_back()) found(Fault::overheated, now);
  if ((out.causes & kNotFinite) != 0) {
    found(Fault::wrench_not_finite, now);
    lose_place();  // whatever it came from shall not come back with the next tick
    record_.authority = 0.0;
  }
  if (is_driving(machine_.state())) found(watches_.motor_stall.check(out.F, sample.X_BH, now), now);
  return out;
}

bool ServoLoop::calm(const DeviceSample& sample) const noexcept {
  return felt().proxy_valid() && sampled_ && sample.V_BH.linear_m_per_s.norm() < kCalmSpeed_m_per_s &&
         sample.V_BH.angular_rad_per_s.norm() < kCalmAngularSpeed_rad_per_s &&
         F_out_.force_N.norm() <= kCalmLimitFraction * limits_.max_force_N() &&
         F_out_.torque_Nm.norm() <= kCalmLimitFraction * limits_.max_torque_Nm();
}

/// The stiffness that stays passive with the rate and the delay that were measured just now.
void ServoLoop::settle_stiffness(TimePoint now) noexcept {
  const auto [spring, damper, bounded] = steady_.derive_stiffness();
  scale_renderings();
  if (!bounded) say(Event::Kind::stability_bound_unknown, now);
  if (spring < 1.0 || damper < 1.0) say(Event::Kind::stiffness_scaled, now, 0, spring);
}

/// Line 8. In the self-test the device hears what the test wants it to hear. A wrench that was refused for
/// too long is not what the device shall find when it listens again.
void ServoLoop::send(TimePoint now, Limited& out) noexcept {
  const bool testing = machine_.state() == State::self_test;
  if (testing && !self_test_.sends_commands()) return;
  const bool drives = is_driving(machine_.state());
  hand_over(now, out.F, testing ? self_test_.motors_on() : drives);
  found(watches_.writes.check(static_cast<Fault>(record_.write_fault), now), now);
  const bool may_drive = is_driving(machine_.state()) || machine_.state() == State::self_test;
  if (!motors_told_ || may_drive || (found_ & bit(Fault::device_lost)) != 0) return;
  out.F = Wrench{};
  limits_.reset();
  hand_over(now, out.F, false);
}

void ServoLoop::hand_over(TimePoint now, const Wrench& F, bool motors_on) noexcept {
  motors_told_ = motors_on;
  record_.motors_commanded = motors_on ? 1 : 0;
  record_.write_fault = static_cast<std::uint8_t>(device_.write(now, F, motors_on));
  const Wrench of_contact = F - record_.authority * F_weight_;
  steady_.record_sent(motors_on ? of_contact : Wrench{});
}

/// The tick's record goes to whoever looks, its times into the histograms, its news to the log.
void ServoLoop::finish(TimePoint now, const Limited& out) noexcept {
  if (!is_driving(machine_.state()) && machine_.state() != State::waiting) watches_.client.stop();
  describe(out);
  say_changes(now);
  publish();
  for (std::size_t i = 0; i < kStageCount; ++i) timing_.stage[i].add(Duration(record_.stage_ns[i]));
  timing_.wake_latency.add(Duration(record_.wake_latency_ns));
  timing_.tick.add(clock_.now() - tick_start_);
}

void ServoLoop::describe(const Limited& out) noexcept {
  const Rendering& rendering = felt();
  const Penetration& depth = rendering.depth();
  record_.X_WP = numbers(rendering.X_WP());
  record_.X_WQ.fill(kNotSet);
  if (rendering.proxy_valid()) record_.X_WQ = numbers(rendering.X_WQ());
  record_.eps.fill(kNotSet);
  record_.energy = record_.kkt_residual = kNotSet;
  if (rendering.proxy_initialization() == ProxyInitialization::complete) {
    record_.eps = numbers(depth.eps.head<3>(), depth.eps.tail<3>());
    record_.energy = depth.projection.energy;
    record_.kkt_residual = depth.projection.kkt_residual;
  }
  record_.F_T = numbers(rendering.F_T().force_N, rendering.F_T().torque_Nm);
  record_.contacts = depth.contacts;
  record_.iterations = depth.projection.iterations;
  record_.projection_status = static_cast<std::uint8_t>(depth.projection.status);
  record_.proxy_initialization = static_cast<std::uint8_t>(rendering.proxy_initialization());
  record_.rendering_id = rendering.id();
  record_.rendering_checksum = rendering.checksum();
  record_.next_rendering_weight = renderings_.next_weight();
  record_.contact_gain = through_;
  record_.change_count = changes_;
  record_.state = static_cast<std::uint8_t>(machine_.state());
  record_.state_cause = static_cast<std::uint8_t>(machine_.cause());
  record_.faults = found_;
  record_.stiffness_scale = steady_.effective_stiffness_scale();
  record_.passivity_scale = steady_.guard().scale();
  record_.energy_in_J = steady_.guard().energy_in_J();
  record_.energy_out_J = steady_.guard().energy_out_J();
  record_.injected_J = steady_.guard().injected_J();
  record_.limit_causes = out.causes;
  record_.undriven_dofs = dropped_;
  record_.F_out = numbers(out.F.force_N, out.F.torque_Nm);
}

void ServoLoop::publish() noexcept {
  seen_state_.store(machine_.state(), std::memory_order_relaxed);
  seen_cause_.store(machine_.cause(), std::memory_order_relaxed);
  seen_rendering_.store(felt().id(), std::memory_order_relaxed);
  seen_changing_.store(renderings_.next() != nullptr, std::memory_order_relaxed);
  latest_.write(record_);
  if (shown_ != nullptr) shown_->write(record_, touches());
}

/// The contacts of the tick, for whoever looks.
Touches ServoLoop::touches() const noexcept {
  return felt().contacts();
}

void ServoLoop::record_sample(const DeviceSample& sample) noexcept {
  record_.arrived_ns = sample.arrived.time_since_epoch().count();
  record_.device_time_s = sample.device_time_s;
  record_.sequence = sample.sequence;
  record_.acknowledged_command = sample.acknowledged;
  record_.superseded = sample.superseded;
  record_.missing = sample.missing;
  record_.rejected = sample.rejected;
  record_.repeated = sample.repeated;
  record_.buttons = sample.buttons;
  record_.fresh = sample.fresh ? 1 : 0;
  record_.motors_on = sample.motors_on ? 1 : 0;
  record_.watchdog_tripped = sample.watchdog_tripped ? 1 : 0;
  record_.homed = sample.homed ? 1 : 0;
  record_.sample_fault = static_cast<std::uint8_t>(sample.fault);
  record_.X_BH = numbers(sample.X_BH);
  record_.V_BH = numbers(sample.V_BH.linear_m_per_s, sample.V_BH.angular_rad_per_s);
}

void ServoLoop::say_changes(TimePoint now) noexcept {
  if (machine_.state() != said_state_)
    say(Event::Kind::state_changed, now, static_cast<std::uint32_t>(machine_.state()),
        static_cast<double>(machine_.cause()));
  said_state_ = machine_.state();
  say_placing(now);
}

/// Each once: that the proxy's place is looked for, that it was found, that there is none.
void ServoLoop::say_placing(TimePoint now) noexcept {
  const bool placed = felt().proxy_valid();
  if (placed != said_placed_) {
    if (placed)
      say(Event::Kind::proxy_found, now, 0,
          (felt().X_WQ().translation_m - felt().X_WP().translation_m).norm());
    else
      say(Event::Kind::proxy_search_started, now);
  }
  said_placed_ = placed;
  const bool nowhere = felt().proxy_initialization() == ProxyInitialization::failed;
  if (nowhere && !said_nowhere_) say(Event::Kind::proxy_search_failed, now);
  said_nowhere_ = said_nowhere_ || nowhere;
  if (felt().proxy_initialization() != ProxyInitialization::complete) return;
  const ProjectionStatus status = felt().depth().projection.status;
  if (status != said_status_ && status == ProjectionStatus::infeasible)
    say(Event::Kind::projection_infeasible, now);
  said_status_ = status;
}

void ServoLoop::lap(Stage stage) noexcept {
  const TimePoint t = clock_.now();
  record_.stage_ns[static_cast<std::size_t>(stage)] = (t - lap_start_).count();
  lap_start_ = t;
}

void ServoLoop::say(Event::Kind kind, TimePoint at, std::uint32_t detail, double value) noexcept {
  if (!events_.push(Event{kind, at, detail, value})) dropped_events_.fetch_add(1, std::memory_order_relaxed);
}

}  // namespace wrenchd
