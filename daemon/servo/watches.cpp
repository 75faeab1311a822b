// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/watches.hpp"

#include "core/finite.hpp"

namespace wrenchd {

Watches::Watches(const DeviceProfile& profile, double max_force_N, double max_torque_Nm)
    : link(profile.report_rate_Hz),
      pose(profile),
      motor_stall(max_force_N, max_torque_Nm),
      deadman_button(button_bit(profile.deadman_button)),
      stop_button(button_bit(profile.stop_button)),
      has_motors(profile.has_output) {}

FaultSet Watches::check(const DeviceSample& sample, State state, bool driven, const TickTime& t) noexcept {
  FaultSet faults = link.check(sample, t.now) | pose.check(sample) | motors.check(sample, driven, t.now);
  faults |= classify_sample_fault(sample.fault, state, t.recently_late);
  if (!is_finite(sample.X_BH) || !is_finite(sample.V_BH)) faults |= bit(Fault::pose_not_finite);
  if (was_homed_ && !sample.homed) faults |= bit(Fault::not_homed);
  const bool report_received = sample.arrived != TimePoint{};  // `homed` is not valid before the first report
  if (report_received) was_homed_ = sample.homed;
  return faults | check_buttons(sample, state) | client.check(t.now);
}

/// Maps a fault of the device driver to the fault that counts in this state.
FaultSet Watches::classify_sample_fault(Fault fault, State state, bool recently_late) const noexcept {
  switch (fault) {
    case Fault::none:
    case Fault::pose_not_a_rotation:  // PoseWatch raises it after three such poses in a row
      return 0;
    case Fault::overspeed:  // a fast handle is harmless while no force acts
      return is_driving(state) ? bit(fault) : 0;
    // After a late tick the driver's queue may have overflowed, so the sample is old but the device was not
    // silent. A device without motors is harmless when silent: the pose stays constant.
    case Fault::sample_stale:
      return bit(recently_late || !has_motors ? Fault::sample_late : fault);
    default:
      return bit(fault);
  }
}

FaultSet Watches::check_buttons(const DeviceSample& sample, State state) const noexcept {
  FaultSet faults = 0;
  if ((sample.buttons & stop_button) != 0) faults |= bit(Fault::stop_button);
  const bool armed = is_driving(state) || state == State::waiting;
  if (armed && deadman_button != 0 && (sample.buttons & deadman_button) == 0)
    faults |= bit(Fault::deadman_released);
  return faults;
}

void Watches::reset() noexcept {
  link.reset();
  pose.reset();
  motors = MotorWatch();
  was_homed_ = false;
}

}  // namespace wrenchd
