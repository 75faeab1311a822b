// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/fault.hpp"
#include "core/oscillation.hpp"
#include "daemon/servo/stability_analysis.hpp"
#include "devices/device.hpp"

namespace wrenchd {

/// Keeps the contact passive. Measures rate and delay of the loop, derives the stiffness that stays passive,
/// halves the wrench if the handle oscillates, and limits generated energy with a passivity guard.
/// daemon/servo/README.md, section "Contact stabiliser"; core/METHOD.md, sections 10 and 11.
class ContactStabilizer {
 public:
  /// stability: analysis of the rendering of the start. Not RT-safe: throws std::invalid_argument if the
  /// profile states negative damping.
  ContactStabilizer(const Settings& settings, const DeviceProfile& profile,
                    const StabilityAnalysis& stability);

  // --- measurement of the loop ---

  /// Discards all measurements. RT-safe.
  void start_measurement() noexcept { measurement_.reset(); }
  /// Adds the times of one tick. last_command_sent: number of the last command sent before this tick.
  /// RT-safe.
  void update_measurement(const DeviceSample& sample, std::uint64_t last_command_sent,
                          TimePoint now) noexcept;
  /// Derives the stiffness scale and a new passivity guard from the measurements since start_measurement().
  /// Returns the stiffness scale. RT-safe.
  const StiffnessScale& derive_stiffness() noexcept;
  /// Returns the stiffness scale of the active rendering. RT-safe.
  const StiffnessScale& stiffness_scale() const noexcept { return stiffness_scale_; }
  /// Returns the scale of another rendering for the measurements of the last derive_stiffness(). If no
  /// measurement exists yet, returns 1 (no scaling). RT-safe.
  StiffnessScale max_stable_scale(const StabilityAnalysis& stability) const noexcept;
  /// Returns the scale of local models, 0 to 1. Uses the measurements of the last derive_stiffness(); if none
  /// exist yet, uses the current measurements. RT-safe.
  double max_stable_scale(const LocalModels::TotalGains& gains) const noexcept {
    return stability_.max_stable_scale_at_handle(stiffness_derived_ ? derivation_measurement_ : measurement_,
                                                 gains);
  }
  /// Replaces the analysis when another rendering becomes active, and derives its stiffness scale. RT-safe.
  void set_stability(const StabilityAnalysis& stability) noexcept;
  /// Sets the workspace scale (metres of tool motion per metre of handle motion) and derives the stiffness
  /// scale. Returns true if the value changed. RT-safe.
  bool set_workspace_scale(double scale) noexcept;

  // --- contact ---

  struct ContactInput {
    State state = State::disarmed;  ///< State of the loop.
    bool sample_usable = false;     ///< True if the sample is new and valid.
    bool in_contact = false;        ///< True if a contact contributes to the wrench.
    double stored_energy_J = 0.0;   ///< Energy stored in the contact spring.
  };
  /// Returns the wrench that may act: `requested` times the oscillation gain, limited by the passivity guard.
  /// `requested` excludes the weight compensation, whose work on the hand is intended. Both wrenches are
  /// about the handle point, in axes of B. The guard is active in driving states other than ramping; when
  /// ramping ends, it credits stored_energy_J. RT-safe.
  Wrench stabilize(const Wrench& requested, const DeviceSample& sample, const ContactInput& input) noexcept;
  /// Credits energy that a change other than hand motion stored in the spring, so that the loop may return it
  /// to the hand. RT-safe.
  void credit(double energy_J) noexcept {
    if (guard_active_) guard_.credit(energy_J);
  }
  /// Accounts for the work of moving obstacles on the spring in this tick. Positive work is credited;
  /// negative work cancels stored energy. RT-safe.
  void credit_obstacle_work(double work_J) noexcept {
    if (guard_active_) guard_.credit_obstacle_work(oscillation_gain_ * work_J);
  }
  /// Records the contact wrench that was sent, after all limits. RT-safe.
  void record_sent(const Wrench& sent) noexcept { guard_.record_sent(sent); }

  /// Returns the faults that the last stabilize() found. RT-safe.
  FaultSet faults() const noexcept { return faults_; }
  /// Returns true if the guard changed the wrench in the last stabilize(). RT-safe.
  bool guard_intervened() const noexcept { return guard_active_ && guard_.intervened(); }
  /// Returns the factor on the configured spring, including the oscillation gain. RT-safe.
  double effective_stiffness_scale() const noexcept { return oscillation_gain_ * stiffness_scale_.spring; }
  const PassivityGuard& guard() const noexcept { return guard_; }  ///< RT-safe.

 private:
  void reset_guard(State state) noexcept;
  void detect_oscillation(const Wrench& requested, const DeviceSample& sample, double dt_s,
                          bool in_contact) noexcept;

  StabilityAnalysis stability_;
  LoopMeasurement measurement_;
  LoopMeasurement derivation_measurement_;  ///< Copy of measurement_ at the last derive_stiffness().
  bool stiffness_derived_ = false;          ///< True after the first derive_stiffness().
  double workspace_scale_ = 1.0;
  PassivityGuard guard_;
  OscillationDetector oscillation_;
  bool wrench_about_handle_;  ///< True if the wrench is about the handle point; the guard needs that.
  bool device_acknowledges_;  ///< True if reports contain the number of the last accepted command.
  StiffnessScale stiffness_scale_;
  FaultSet faults_ = 0;
  State last_state_ = State::disconnected;  ///< State in the previous tick.
  double oscillation_gain_ = 1.0;     ///< Factor on the wrench; halved at each oscillation, reset by arming.
  int oscillation_count_ = 0;         ///< Oscillations since the loop was armed.
  bool guard_active_ = false;         ///< True after the guard processed its first sample.
  double guard_sample_time_s_ = 0.0;  ///< Device time of the guard's last sample.
};

}  // namespace wrenchd
