// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/fault.hpp"
#include "core/oscillation.hpp"
#include "core/passivity.hpp"
#include "core/state.hpp"
#include "devices/device.hpp"

namespace wrenchd {

/// What the contact stage tells the stabilizer in one tick.
struct ContactInput {
  State state = State::disarmed;
  bool sample_usable = false;  ///< The sample is new and may be used.
  bool in_contact = false;
  double stored_energy_J = 0.0;  ///< Energy that the contact springs hold.
  double crossfade_work_J =
      0.0;  ///< Work that fading between renderings did on the springs since the last tick.
  double obstacle_work_J =
      0.0;  ///< Work that moving obstacles did on the springs, negative if they took some.
  double local_model_work_J = 0.0;  ///< Work that fading local models did on their springs.
};

/// A contact wrench that gives the hand no energy of its own.
struct Stabilized {
  Wrench F;                 ///< About the handle point in B.
  FaultSet faults = 0;      ///< Oscillation, or energy that the guard could not hold back.
  bool intervened = false;  ///< The passivity guard changed the wrench.
};

/// Keeps a contact from giving energy that nobody put into it: lowers the stiffness if the handle oscillates,
/// and limits the energy that goes out to what came in (core/METHOD.md, section 11). All members are RT-safe.
class ContactStabilizer {
 public:
  ContactStabilizer(const DeviceProfile& profile, const PassivityGuard& guard) noexcept;

  /// Replaces the guard, after the delay of the loop was measured anew.
  void set_guard(const PassivityGuard& guard) noexcept { guard_ = guard; }

  /// Share of the requested wrench that may go out. While the force rises after arming, the springs are
  /// loaded around a hand that may be inside a wall; the guard therefore starts when the force has risen,
  /// with the energy that the springs hold then as its budget. The wrench that compensates the handle's
  /// weight must not be in `requested`: a hand that lifts the handle receives work.
  Stabilized stabilize(const Wrench& requested, const DeviceSample& sample,
                       const ContactInput& contact) noexcept;
  /// Records the contact wrench that was sent, after the limits; zero if the motors are off.
  void record_sent(const Wrench& F) noexcept { guard_.record_sent(F); }

  /// Factor on the stiffness, lowered by each oscillation since arming; 1 if there was none.
  double oscillation_gain() const noexcept { return oscillation_gain_; }
  const PassivityGuard& guard() const noexcept { return guard_; }

 private:
  void credit(const ContactInput& contact) noexcept;
  void reset_guard(State state) noexcept;
  FaultSet detect_oscillation(const Wrench& requested, const DeviceSample& sample, double dt_s,
                              bool in_contact) noexcept;

  PassivityGuard guard_;
  OscillationDetector oscillation_;
  bool wrench_about_handle_;                ///< The guard only understands wrenches about the handle point.
  State last_state_ = State::disconnected;  ///< State in the previous call of stabilize().
  double oscillation_gain_ = 1.0;
  int oscillation_count_ = 0;  ///< Oscillations since the loop was armed.
  bool guard_active_ = false;
  double guard_sample_time_s_ = 0.0;  ///< Device time of the sample that the guard saw last.
};

}  // namespace wrenchd
