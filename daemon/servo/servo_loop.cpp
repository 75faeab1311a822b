// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/servo_loop.hpp"

#include "daemon/servo/due_time.hpp"

// What wrenchd does, a thousand times a second or more (Algorithm 1 of the paper):
//
//   device -> pose p -> contacts -> projection q -> wrench -> limits -> device
//
// tick() is that line: each stage takes values and returns values, and telemetry writes them down at the end.
// run() waits for the next tick. Every way out passes a release of the hand.

namespace wrenchd {

ServoLoop::ServoLoop(const Settings& settings, const DeviceProfile& profile, Device& device,
                     std::unique_ptr<Rendering> rendering, const Clock& clock)
    : pacing_(settings.servo.pacing),
      period_(from_seconds(1.0 / settings.servo.rate_Hz)),
      clock_(clock, make_pace_watch(settings.servo)),
      port_(device),
      renderer_(settings, profile, std::move(rendering), requests_.renderings(), telemetry_.events()),
      output_(settings.limits, profile, renderer_.energy_bounds()),
      supervisor_(settings, profile, output_.max_force_N(), output_.max_torque_Nm(), telemetry_.events()) {
  telemetry_.show_limits(output_.effective_limits());
}

Fault ServoLoop::run(Clock& clock, const std::atomic<bool>& stop) noexcept {
  TimePoint due = clock.now();
  while (supervisor_.state() != State::shutdown || !stop.load(std::memory_order_relaxed)) {
    if (stop.load(std::memory_order_relaxed)) requests_.request(kQuit);
    due = wait_for_next(clock, due);
    if (tick(clock.now(), due) == Fault::device_lost) return Fault::device_lost;  // the hand was released
  }
  return Fault::none;
}

Fault ServoLoop::tick(TimePoint now, TimePoint due) noexcept {
  const TickTime t = clock_.begin(now, due);
  const Requests asked = requests_.take();
  const DeviceReading in = port_.read(t.now);
  const DeviceSample& s = in.sample;
  clock_.lap(Stage::read);

  const Verdict v = supervisor_.judge(s, asked.commands, port_.last(), renderer_.proxy_valid(), t);
  if (v.self_test_passed) output_.set_bounds(renderer_.derive_stiffness(t));
  const std::uint32_t changes = renderer_.apply(asked, v, in, t);
  if (asked.limits) change_limits(*asked.limits, v.armed());
  if (v.release) return leave(t, asked, in, Written{}, {});

  const ContactState c = renderer_.project(s, v, output_.contact_share(), t);  // p, its proxy q, eps
  clock_.lap(Stage::projection);

  const Demand d = renderer_.compute_wrench(c, s, v, output_.fade_limits(), t);  // Eq. (16) or the energy law
  const TimePoint ready = clock_.lap(Stage::wrench);

  const Stabilized f = output_.stabilize(d, s, supervisor_.preview(d, s, ready, t));  // passivity
  const Authority a = supervisor_.authorise(d, f, output_.overheated(), s, ready, t);
  const Limited out =
      output_.limit(f, d, a, s, t);  // account, magnitude, heat, workspace, soft start, slew, power
  clock_.lap(Stage::limits);

  const Written w = port_.write(t.now, out.F, a, d.contact.X_BH_held);
  clock_.lap(Stage::write);
  if (w.device_lost()) return leave(t, asked, in, w, ready);
  return finish(t, asked, changes, in, d, a, out, w, ready);
}

void ServoLoop::change_limits(const LimitSettings& limits, bool armed) noexcept {
  const LimitSettings effective = output_.set_limits(limits, armed);
  supervisor_.set_limits(effective);
  telemetry_.show_limits(effective);
}

/// Writes down what the tick computed. Returns the fault that changed the state in it.
Fault ServoLoop::finish(const TickTime& t, const Requests& asked, std::uint32_t changes,
                        const DeviceReading& in, const Demand& d, const Authority& a, const Limited& out,
                        const Written& w, TimePoint ready) noexcept {
  telemetry_.publish({t, in, d, a, w, asked, out.causes, changes, ready, clock_.stage_ns(),
                      renderer_.stiffness_scale(), output_.stabilizer(), output_.external()},
                     supervisor_, renderer_.active());
  telemetry_.count_times(t, clock_.stage_ns(), clock_.elapsed());
  return supervisor_.changed_by();
}

void ServoLoop::release(TimePoint now) noexcept {
  supervisor_.end();
  port_.release(now);
  forget_device();
  telemetry_.publish_release(now, supervisor_, renderer_.current_demand(), renderer_.active());
}

/// Ends the operation of a device: releases the hand, as far as the device can still be reached, and prepares
/// for a device that is opened next.
Fault ServoLoop::leave(const TickTime& t, const Requests& asked, const DeviceReading& in,
                       const Written& last_write, TimePoint ready) noexcept {
  if (last_write.device_lost()) supervisor_.lose_device(t);
  renderer_.leave_shared_world();
  Written released = port_.release(t.now);
  released.result = last_write.result;
  forget_device();
  const Authority none;
  telemetry_.publish(
      {t, in, renderer_.current_demand(), none, released, asked, kNotLimited, renderer_.change_count(), ready,
       clock_.stage_ns(), renderer_.stiffness_scale(), output_.stabilizer(), output_.external(), true},
      supervisor_, renderer_.active());
  return (supervisor_.faults() & bit(Fault::device_lost)) != 0 ? Fault::device_lost
                                                               : supervisor_.changed_by();
}

/// The next device may be another one, with another clock.
void ServoLoop::forget_device() noexcept {
  output_.reset();
  renderer_.forget_device();
  supervisor_.forget_device();
}

/// Sleeps until the next tick is due, by the clock or by the device's next report. If the loop fell behind,
/// it skips the missed ticks.
TimePoint ServoLoop::wait_for_next(Clock& clock, TimePoint due) noexcept {
  if (pacing_ == Pacing::device) {
    port_.wait_readable(clock.now() + kDeviceTimeout_periods * period_);
    return clock.now();
  }
  TimePoint next = due + period_;
  if (const std::uint64_t missed = skip_missed_ticks(next, period_, clock.now()); missed > 0)
    telemetry_.count_overrun(missed);
  clock.sleep_until(next);
  return next;
}

}  // namespace wrenchd
