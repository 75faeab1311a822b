// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/fault.hpp"
#include "core/oscillation.hpp"
#include "daemon/servo/stability_analysis.hpp"
#include "devices/device.hpp"

namespace wrenchd {

/// Keeps a contact from giving what nobody put into it: measures the loop, takes from that how stiff its
/// walls may be, gives less where the handle buzzes all the same, and guards the energy. RT safe.
class ContactStabilizer {
 public:
  /// stability: of what is rendered first.
  ContactStabilizer(const Settings& settings, const DeviceProfile& profile,
                    const StabilityAnalysis& stability);

  // --- the loop as it is, once a tick ---
  void start_measurement() noexcept { measurement_.reset(); }
  /// commanded: number of the last command sent before this tick.
  void update_measurement(const DeviceSample& sample, std::uint64_t commanded, TimePoint now) noexcept;
  /// How stiff the walls may be by what was measured since start_measurement(); the guard goes by that too.
  const StiffnessScale& derive_stiffness() noexcept;
  const StiffnessScale& stiffness_scale() const noexcept { return stiffness_scale_; }
  /// How stiff other walls may be, by what was measured when settle() was called last: as stiff as they are
  /// where that was never.
  StiffnessScale max_stable_scale(const StabilityAnalysis& stability) const noexcept;
  /// Likewise of springs and brakes about the handle.
  double max_stable_scale(const LocalModels::TotalGains& load) const noexcept {
    return stability_.max_stable_scale_at_handle(stiffness_derived_ ? derivation_measurement_ : measurement_,
                                                 load);
  }
  /// These are the walls from here on.
  void set_stability(const StabilityAnalysis& stability) noexcept;
  /// Metres that the tool goes for a metre of the handle, from here on. Whether that is another than before:
  /// then it bears another share().
  bool set_workspace_scale(double scale) noexcept;

  // --- the contact ---
  struct ContactInput {
    State state = State::disarmed;
    bool sample_usable = false;  ///< the sample is new, and may be used
    bool in_contact = false;
    double stored_energy_J = 0.0;  ///< what the spring holds
  };
  /// What may go out of the contact's wrench, about the handle point in B. While the force rises the wall is
  /// wound up around a hand that may be in it, so the guard begins when it has risen, and lends what the
  /// spring holds by then. What holds the handle's weight is none of its business: a hand that lifts it is
  /// given work.
  Wrench stabilize(const Wrench& asked, const DeviceSample& sample, const ContactInput& moment) noexcept;
  /// The spring was wound up from outside by so much, and not by the hand: it may give that back.
  void credit(double energy_J) noexcept {
    if (guard_active_) guard_.credit(energy_J);
  }
  /// Obstacles that move wound it up by so much in this tick, or took so much out of it (below 0).
  void credit_obstacle_work(double energy_J) noexcept {
    if (guard_active_) guard_.credit_obstacle_work(oscillation_gain_ * energy_J);
  }
  /// What went out of it, after the limits.
  void record_sent(const Wrench& sent) noexcept { guard_.record_sent(sent); }

  /// What steadied() found in this tick.
  FaultSet faults() const noexcept { return faults_; }
  /// Did the guard change the wrench in this tick?
  bool guard_intervened() const noexcept { return guard_active_ && guard_.intervened(); }
  /// Of the spring that the configuration asks for, with what oscillations have left of it.
  double effective_stiffness_scale() const noexcept { return oscillation_gain_ * stiffness_scale_.spring; }
  const PassivityGuard& guard() const noexcept { return guard_; }

 private:
  void reset_guard(State state) noexcept;
  void detect_oscillation(const Wrench& asked, const DeviceSample& sample, double dt_s,
                          bool in_contact) noexcept;

  StabilityAnalysis stability_;
  LoopMeasurement measurement_;
  LoopMeasurement derivation_measurement_;  ///< what was measured by then
  bool stiffness_derived_ = false;
  double workspace_scale_ = 1.0;
  PassivityGuard guard_;
  OscillationDetector oscillation_;
  bool wrench_about_handle_;  ///< wrenches are about the handle: of others the guard knows nothing
  bool device_acknowledges_;  ///< the device says which commands it took
  StiffnessScale stiffness_scale_;
  FaultSet faults_ = 0;
  State last_state_ = State::disconnected;  ///< of the last tick
  double oscillation_gain_ = 1.0;           ///< what oscillations have left, since the loop was armed
  int oscillation_count_ = 0;               ///< since then
  bool guard_active_ = false;
  double guard_sample_time_s_ = 0.0;  ///< device time of the guard's last sample
};

}  // namespace wrenchd
