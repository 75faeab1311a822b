// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/fault.hpp"
#include "core/oscillation.hpp"
#include "core/passivity.hpp"
#include "core/state.hpp"
#include "devices/device.hpp"

namespace wrenchd {

/// Input of the stabilizer in one tick.
struct ContactInput {
  State state = State::disarmed;  ///< State of the loop.
  bool sample_usable = false;     ///< True if the sample is new and valid.
  bool in_contact = false;        ///< True if a contact contributes to the wrench.
  double stored_energy_J = 0.0;   ///< Energy stored in the contact springs.
  double crossfade_work_J = 0.0;  ///< Work of a cross-fade on the springs in this tick.
  double obstacle_work_J = 0.0;   ///< Work of moving obstacles on the springs; negative if they unload them.
  double local_model_work_J = 0.0;  ///< Work of fading local models on their springs.
};

/// Result of the stabilizer.
struct Stabilized {
  Wrench F;                 ///< Contact wrench that may be sent, about the handle point, in axes of B.
  FaultSet faults = 0;      ///< oscillating, oscillation_persists or energy_generated.
  bool intervened = false;  ///< True if the passivity guard changed the wrench.
};

/// Keeps the contact passive: halves the wrench if the handle oscillates, and limits generated energy with a
/// passivity guard. core/METHOD.md, section 11; daemon/servo/README.md, section "Contact stabiliser". All
/// members are RT-safe.
class ContactStabilizer {
 public:
  ContactStabilizer(const DeviceProfile& profile, const PassivityGuard& guard) noexcept;

  /// Replaces the guard after a new measurement of the loop's delay.
  void set_guard(const PassivityGuard& guard) noexcept { guard_ = guard; }

  /// Returns the wrench that may be sent: `requested` times the oscillation gain, limited by the passivity
  /// guard. `requested` must exclude the weight compensation, whose work on the hand is intended. Both
  /// wrenches are about the handle point, in axes of B. The guard is idle while the force ramps up after
  /// arming. When the ramp ends, the guard starts with stored_energy_J as credit.
  Stabilized stabilize(const Wrench& requested, const DeviceSample& sample,
                       const ContactInput& contact) noexcept;
  /// Records the contact wrench that was sent, after all limits; zero if the motors are off.
  void record_sent(const Wrench& F) noexcept { guard_.record_sent(F); }

  /// Returns the factor on the contact wrench. Each oscillation halves it; arming resets it to 1.
  double oscillation_gain() const noexcept { return oscillation_gain_; }
  const PassivityGuard& guard() const noexcept { return guard_; }

 private:
  void credit(const ContactInput& contact) noexcept;
  void reset_guard(State state) noexcept;
  FaultSet detect_oscillation(const Wrench& requested, const DeviceSample& sample, double dt_s,
                              bool in_contact) noexcept;

  PassivityGuard guard_;
  OscillationDetector oscillation_;
  bool wrench_about_handle_;  ///< True if the profile's wrench is about the handle; the guard needs that.
  State last_state_ = State::disconnected;  ///< State in the previous stabilize().
  double oscillation_gain_ = 1.0;
  int oscillation_count_ = 0;         ///< Oscillations since the loop was armed.
  bool guard_active_ = false;         ///< True after the guard processed its first sample.
  double guard_sample_time_s_ = 0.0;  ///< Device time of the guard's last sample.
};

}  // namespace wrenchd
