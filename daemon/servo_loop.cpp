// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo_loop.hpp"

#include <algorithm>
#include <limits>

#include "core/energy_law.hpp"
#include "core/finite.hpp"

// What wrenchd does, a thousand times a second or more (Algorithm 1 of the paper):
//
//   device -> pose p -> contacts -> projection q -> wrench -> limits -> device
//
// tick() is that line. Above it is run(), which waits for the next tick and lets nobody out without
// release(); below it are the stages, in order.

namespace wrenchd {
namespace {

/// A sample older than this no longer pushes: the wrench is zero until a new one comes. A few reports at 1
/// kHz.
constexpr Duration kStaleAfter = std::chrono::milliseconds(3);
/// A handle that says nothing for this many periods is looked at all the same, when the device sets the pace.
constexpr int kDevicePatience_periods = 4;
/// Where the placer found no room it is asked again after so long: a search without end would keep a
/// processor busy, and a hand does not go far in that time.
constexpr Duration kAskAgainAfter = std::chrono::milliseconds(100);

constexpr double kNotSet = std::numeric_limits<double>::quiet_NaN();

Pose pose_of(const PlacementSettings& placement) noexcept {
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
                     const Scene& scene, Placer& placer, const Clock& clock, RecordRing* records)
    : device_(device),
      placer_(placer),
      clock_(clock),
      records_(records),
      X_WB_(pose_of(settings.device.base_in_world)),
      X_HT_(pose_of(settings.device.tool_in_handle) * scene.tool().X_MT()),
      wrench_point_(profile.wrench_point),
      driven_(driven_dofs(profile)),
      pacing_(settings.servo.pacing),
      period_(from_seconds(1.0 / settings.servo.rate_Hz)),
      late_limit_(from_seconds(settings.servo.late_limit_s)),
      penetration_(scene,
                   {settings.rendering.method, settings.rendering.planes, 0.0, settings.rendering.friction}),
      moves_(scene.moves()),
      spring_(settings.wrench.law),
      energy_stiffness_per_s2_(settings.wrench.energy_stiffness_per_s2),
      M_(scene.tool().solid.inertia),
      law_(gains_for(settings.rendering.method, settings.wrench.gains)),
      gravity_(profile.masses, X_WB_.rotation),
      limits_(settings.limits, profile.max_force_N, profile.max_torque_Nm),
      soft_start_(settings.limits.soft_start_s) {
  lose_place();
}

Fault ServoLoop::run(Clock& clock, const std::atomic<bool>& stop) noexcept {
  TimePoint due = clock.now();
  while (!stop.load(std::memory_order_relaxed)) {
    due = wait_for_next(clock, due);
    const Fault fault = tick(clock.now(), due);
    if (fault != Fault::none) return fault;  // tick() has released the hand
  }
  return release(clock.now(), Fault::none);
}

Fault ServoLoop::tick(TimePoint now, TimePoint due) noexcept {
  begin(now, due);

  const DeviceSample sample = device_.read_newest(now);  // the pose the hand gives
  record_sample(sample);
  lap(Stage::read);
  if (sample.fault != Fault::none) return release(now, sample.fault);
  if (!is_finite(sample.X_BH) || !is_finite(sample.V_BH)) return release(now, Fault::pose_not_finite);

  if (sample.fresh) project(sample);  // contacts, and the closest admissible configuration q
  lap(Stage::projection);

  if (sample.fresh) compute_wrench(sample);  // Eq. (16) or the energy law, from p to q
  lap(Stage::wrench);

  const Limited out = limit(sample, now);  // soft start, magnitude, slew
  lap(Stage::limits);
  if ((out.causes & kNotFinite) != 0) return release(now, Fault::wrench_not_finite);

  const Fault written = device_.write(now, out.F, soft_start_.state() >= Engagement::ramping);
  lap(Stage::write);
  if (written != Fault::none) return release(now, written);

  finish(now, sample, out);
  return Fault::none;
}

Fault ServoLoop::release(TimePoint now, Fault why) noexcept {
  device_.release(now);
  soft_start_.disarm();
  limits_.reset();
  law_.reset();
  sampled_ = false;  // what comes next may be a device that was plugged in anew, with another clock
  if (why != Fault::none) say(Event::Kind::fault, now, static_cast<std::uint32_t>(why));
  say(Event::Kind::released, now);
  record_.fault = static_cast<std::uint8_t>(why);
  record_.released = 1;
  describe(Limited{});
  publish();
  return why;
}

/// Sleeps until the next tick is due, by the clock or by the device's next report. A loop that fell behind
/// leaves out the ticks it missed: two ticks in a row on old news would help nobody.
TimePoint ServoLoop::wait_for_next(Clock& clock, TimePoint due) noexcept {
  if (pacing_ == Pacing::device) {
    device_.wait_readable(clock.now() + kDevicePatience_periods * period_);
    return clock.now();
  }
  TimePoint next = due + period_;
  const TimePoint now = clock.now();
  if (now > next) {
    const auto missed = (now - next) / period_ + 1;
    timing_.overruns.fetch_add(1, std::memory_order_relaxed);
    timing_.skipped.fetch_add(static_cast<std::uint64_t>(missed), std::memory_order_relaxed);
    next += missed * period_;
  }
  clock.sleep_until(next);
  return next;
}

/// Starts the tick's record, takes arm, disarm and start over, and looks at the time: after a gap (a stalled
/// machine, a debugger, a suspend) the hand gets nothing until the soft start has run again.
void ServoLoop::begin(TimePoint now, TimePoint due) noexcept {
  tick_start_ = lap_start_ = clock_.now();
  const std::uint64_t tick = record_.tick + (last_tick_ ? 1 : 0);
  record_ = TickRecord{};
  record_.tick = tick;
  record_.now_ns = now.time_since_epoch().count();
  record_.wake_latency_ns = (now - due).count();
  record_.arm_command = arm_command_.exchange(0, std::memory_order_relaxed);
  record_.start_over = start_over_command_.exchange(0, std::memory_order_relaxed);
  obey_commands();

  const Duration since_last = last_tick_ ? now - *last_tick_ : period_;
  dt_s_ = std::min(seconds(since_last), 2.0 * seconds(period_));  // a gap must not let the slew limit leap
  if (since_last > late_limit_ + period_) {
    soft_start_.interrupt();
    limits_.reset();
    say(Event::Kind::late_tick, now, 0, seconds(since_last - period_));
  }
  if (!last_tick_) first_tick_ = now;
  last_tick_ = now;
  scene_time_s_ = seconds(now - first_tick_);
}

/// A hand that felt nothing may have gone through walls while the proxy stayed behind: arming starts over.
void ServoLoop::obey_commands() noexcept {
  const bool arms = record_.arm_command == 1 && soft_start_.state() == Engagement::disarmed;
  if ((arms && has_place()) || record_.start_over != 0) lose_place();
  if (arms) soft_start_.arm();
  if (record_.arm_command == 2) soft_start_.disarm();
}

/// Nothing is known of q: no contact, zero wrench, and the soft start waits.
void ServoLoop::lose_place() noexcept {
  placing_ = Placing::seeking;
  asked_ = false;
  said_nowhere_ = false;
  penetration_.forget();
  depth_ = Penetration{};
  depth_.projection.status = ProjectionStatus::infeasible;
  F_T_ = F_out_ = F_weight_ = Wrench{};
  dropped_ = kNoDof;
  law_.reset();
  limits_.reset();
  soft_start_.interrupt();
}

/// Lines 2 to 6: p from the sample, and its projection q, which follows the hand from last tick's as a proxy.
/// One that is caught between obstacles that move has lost its place.
void ServoLoop::project(const DeviceSample& sample) noexcept {
  X_WP_ = X_WB_ * sample.X_BH * X_HT_;
  if (!has_place()) return place();
  depth_ = penetration_.follow(X_WP_, X_WQ_, scene_time_s_);
  if (moves_ && depth_.projection.status == ProjectionStatus::infeasible) return lose_place();
  X_WQ_ = depth_.projection.X_WQ;
  placing_ = Placing::following;
}

/// There is no q to follow from. The search for one may take seconds, so another thread does it, whatever the
/// scene: asked at one tick, it answers at a later one, with a pose near to where the hand was then. That is
/// this tick's q, and the next follows from it, and makes up for what obstacles have moved since.
void ServoLoop::place() noexcept {
  if (!asked_) {
    if (placing_ == Placing::nowhere && *last_tick_ < ask_again_) return;
    placing_ = Placing::seeking;
    placer_.ask({++question_, X_WP_, scene_time_s_});
    asked_ = true;
    return;
  }
  PlacementAnswer answer;
  if (!placer_.answer(answer) || answer.number != question_)
    return;  // one that was asked before we started over
  asked_ = false;
  placing_ = answer.found ? Placing::placed : Placing::nowhere;
  X_WQ_ = answer.X_WQ;
  penetration_.forget(answer.scene_time_s);
  ask_again_ = *last_tick_ + kAskAgainAfter;
}

/// Line 7: the body wrench, and the same wrench as the device wants it. The law runs on the device's clock,
/// which knows when the poses were taken. Without a q there is no contact. What the device has no motors for
/// is dropped here, and told.
void ServoLoop::compute_wrench(const DeviceSample& sample) noexcept {
  const double dt_s = sampled_ ? sample.device_time_s - sample_time_s_ : 0.0;
  sample_time_s_ = sample.device_time_s;
  sampled_ = true;
  const bool in_contact = depth_.contacts > 0;
  F_T_ = spring_ == SpringLaw::pid
             ? law_.update(depth_.drive, in_contact, dt_s)
             : law_.update_damping(energy_wrench(M_, energy_stiffness_per_s2_, X_WP_, X_WQ_), depth_.drive,
                                   in_contact, dt_s);
  const Wrench F = outgoing(X_WB_ * sample.X_BH), F_weight = gravity_.wrench(sample.X_BH);
  dropped_ = static_cast<DofMask>(components(F + F_weight) & ~driven_);
  F_out_ = along(F, driven_);
  F_weight_ = along(F_weight, driven_);
}

/// About the handle point in the axes of the device base, or the paper's spatial wrench W_S: as the profile
/// says.
Wrench ServoLoop::outgoing(const Pose& X_WH) const noexcept {
  if (wrench_point_ == WrenchPoint::world_origin) return spatial_wrench(X_WP_, F_T_);
  const Wrench F_H_W = wrench_about(X_WH.translation_m, X_WP_, F_T_);
  return expressed(X_WB_.rotation.conjugate(), F_H_W);
}

/// Line 8, before it goes out: what the hand may feel of the wrench now, with the handle's weight held. The
/// weight is no push, so it does not make the hand wait for calm.
Limited ServoLoop::limit(const DeviceSample& sample, TimePoint now) noexcept {
  stale_ = !sampled_ || now - sample.arrived > kStaleAfter;
  const double authority = soft_start_.advance(calm(sample), dt_s_);
  record_.authority = stale_ ? 0.0 : authority;
  return limits_.apply(F_out_ + F_weight_, record_.authority, dt_s_);
}

bool ServoLoop::calm(const DeviceSample& sample) const noexcept {
  return has_place() && !stale_ && sample.V_BH.linear_m_per_s.norm() < kCalmSpeed_m_per_s &&
         sample.V_BH.angular_rad_per_s.norm() < kCalmAngularSpeed_rad_per_s &&
         F_out_.force_N.norm() <= kCalmShareOfLimit * limits_.max_force_N() &&
         F_out_.torque_Nm.norm() <= kCalmShareOfLimit * limits_.max_torque_Nm();
}

/// The tick's record goes to whoever looks, its times into the histograms, its news to the log.
void ServoLoop::finish(TimePoint now, const DeviceSample& sample, const Limited& out) noexcept {
  describe(out);
  say_changes(now, sample);
  publish();
  for (std::size_t i = 0; i < kStageCount; ++i) timing_.stage[i].add(Duration(record_.stage_ns[i]));
  timing_.wake_latency.add(Duration(record_.wake_latency_ns));
  timing_.tick.add(clock_.now() - tick_start_);
}

void ServoLoop::describe(const Limited& out) noexcept {
  record_.X_WP = numbers(X_WP_);
  record_.X_WQ.fill(kNotSet);
  if (has_place()) record_.X_WQ = numbers(X_WQ_);
  record_.eps.fill(kNotSet);
  record_.energy = record_.kkt_residual = kNotSet;
  if (placing_ == Placing::following) {
    record_.eps = numbers(depth_.eps.head<3>(), depth_.eps.tail<3>());
    record_.energy = depth_.projection.energy;
    record_.kkt_residual = depth_.projection.kkt_residual;
  }
  record_.F_T = numbers(F_T_.force_N, F_T_.torque_Nm);
  record_.contacts = depth_.contacts;
  record_.iterations = depth_.projection.iterations;
  record_.projection_status = static_cast<std::uint8_t>(depth_.projection.status);
  record_.placing = static_cast<std::uint8_t>(placing_);
  record_.engagement = static_cast<std::uint8_t>(soft_start_.state());
  record_.limit_causes = out.causes;
  record_.dropped = dropped_;
  record_.F_out = numbers(out.F.force_N, out.F.torque_Nm);
}

void ServoLoop::publish() noexcept {
  latest_.write(record_);
  if (records_ != nullptr && !records_->push(record_))
    dropped_records_.fetch_add(1, std::memory_order_relaxed);
}

void ServoLoop::record_sample(const DeviceSample& sample) noexcept {
  record_.arrived_ns = sample.arrived.time_since_epoch().count();
  record_.device_time_s = sample.device_time_s;
  record_.sequence = sample.sequence;
  record_.acknowledged = sample.acknowledged;
  record_.skipped = sample.skipped;
  record_.missing = sample.missing;
  record_.rejected = sample.rejected;
  record_.buttons = sample.buttons;
  record_.fresh = sample.fresh ? 1 : 0;
  record_.motors_on = sample.motors_on ? 1 : 0;
  record_.watchdog_tripped = sample.watchdog_tripped ? 1 : 0;
  record_.fault = static_cast<std::uint8_t>(sample.fault);
  record_.X_BH = numbers(sample.X_BH);
  record_.V_BH = numbers(sample.V_BH.linear_m_per_s, sample.V_BH.angular_rad_per_s);
}

void ServoLoop::say_changes(TimePoint now, const DeviceSample& sample) noexcept {
  if (sample.missing > 0) say(Event::Kind::reports_missing, now, sample.missing);
  if (sample.rejected > 0) say(Event::Kind::reports_rejected, now, sample.rejected);
  if (stale_ && !said_stale_ && sampled_)
    say(Event::Kind::stale_sample, now, 0, seconds(now - sample.arrived));
  said_stale_ = stale_;
  if (soft_start_.state() != said_engagement_)
    say(Event::Kind::engagement, now, static_cast<std::uint32_t>(soft_start_.state()));
  said_engagement_ = soft_start_.state();
  say_placing(now);
}

/// Each once: that the proxy's place is looked for, that it was found, that there is none.
void ServoLoop::say_placing(TimePoint now) noexcept {
  if (has_place() != said_placed_) {
    if (has_place())
      say(Event::Kind::placed, now, 0, (X_WQ_.translation_m - X_WP_.translation_m).norm());
    else
      say(Event::Kind::placing, now);
  }
  said_placed_ = has_place();
  if (placing_ == Placing::nowhere && !said_nowhere_) say(Event::Kind::nowhere, now);
  said_nowhere_ = said_nowhere_ || placing_ == Placing::nowhere;
  if (placing_ != Placing::following) return;
  const ProjectionStatus status = depth_.projection.status;
  if (status != said_status_ && status == ProjectionStatus::infeasible)
    say(Event::Kind::no_admissible_pose, now);
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
