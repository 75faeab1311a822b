// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/watches.hpp"

#include "core/finite.hpp"

namespace wrenchd {
namespace {

/// Without real-time priority a loop that stands still for a moment is nothing to look at: it is late.
Duration stopped_after(const ServoSettings& servo) noexcept {
  return servo.realtime == Realtime::required ? from_seconds(servo.late_limit_s) : Duration::max();
}

}  // namespace

Watches::Watches(const Settings& settings, const DeviceProfile& profile, double max_force_N,
                 double max_torque_Nm)
    : pace(from_seconds(1.0 / settings.servo.rate_Hz), stopped_after(settings.servo)),
      link(profile.report_rate_Hz),
      pose(profile),
      motor_stall(max_force_N, max_torque_Nm),
      deadman_button(button_bit(profile.deadman_button)),
      stop_button(button_bit(profile.stop_button)),
      has_motors(profile.has_output) {}

FaultSet Watches::check(const DeviceSample& sample, State state, bool driven, TimePoint now) noexcept {
  FaultSet found = link.check(sample, now) | pose.check(sample) | motors.check(sample, driven, now);
  found |= classify_sample_fault(sample.fault, state, now);
  if (!is_finite(sample.X_BH) || !is_finite(sample.V_BH)) found |= bit(Fault::pose_not_finite);
  if (was_homed_ && !sample.homed) found |= bit(Fault::not_homed);
  if (sample.arrived != TimePoint{})
    was_homed_ = sample.homed;  // before the first report it is anybody's guess
  return found | check_buttons(sample, state) | client.check(now);
}

/// What the device found in its reports, as far as it counts here.
FaultSet Watches::classify_sample_fault(Fault fault, State state, TimePoint now) const noexcept {
  switch (fault) {
    case Fault::none:
    case Fault::pose_not_a_rotation:  // three one after the other are one fault, which pose.look() finds
      return 0;
    case Fault::overspeed:  // a hand that is fast while it feels nothing does no harm
      return is_driving(state) ? bit(fault) : 0;
    // A queue that ran over while we were late is no silence of the device's; and one that pushes nobody is
    // no danger: the pose stands still by now, and goes on when it is heard again.
    case Fault::sample_stale:
      return bit(pace.recently_late(now) || !has_motors ? Fault::sample_late : fault);
    default:
      return bit(fault);
  }
}

FaultSet Watches::check_buttons(const DeviceSample& sample, State state) const noexcept {
  FaultSet found = 0;
  if ((sample.buttons & stop_button) != 0) found |= bit(Fault::stop_button);
  const bool wanted = is_driving(state) || state == State::waiting;
  if (wanted && deadman_button != 0 && (sample.buttons & deadman_button) == 0)
    found |= bit(Fault::deadman_released);
  return found;
}

void Watches::reset() noexcept {
  link.reset();
  pose.reset();
  motors = MotorWatch();
  writes.reset();
  was_homed_ = false;
}

}  // namespace wrenchd
