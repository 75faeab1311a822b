// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/loop_measurement.hpp"
#include "core/passivity.hpp"
#include "daemon/servo/stability_analysis.hpp"
#include "devices/device.hpp"

namespace wrenchd {

/// What bounds the energy that the loop gives to the hand: the guard of the contact wrench, and the account
/// of the external wrench.
struct EnergyBounds {
  PassivityGuard guard;
  WorkAccount account;
};

/// Measures period and delay of the running loop, and derives from them how much of the configured stiffness
/// stays passive (core/METHOD.md, section 10). The self-test measures; when it has passed, derive() fixes the
/// result until the next self-test. All members but the constructor are RT-safe.
class StabilityMonitor {
 public:
  /// analysis: of the rendering that is active first. Not RT-safe: may throw.
  StabilityMonitor(const Settings& settings, const DeviceProfile& profile, const StabilityAnalysis& analysis);

  void start_measurement() noexcept { measurement_.reset(); }
  /// Once a tick. last_command_sent: number of the last command sent before the sample was read.
  void update_measurement(const DeviceSample& sample, std::uint64_t last_command_sent,
                          TimePoint now) noexcept;

  /// Derives the scale of stiffness and damping from the measurement since start_measurement().
  const StiffnessScale& derive() noexcept;
  /// Scale of the active rendering: 1 until derive() was called.
  const StiffnessScale& scale() const noexcept { return scale_; }
  /// Scale that another rendering would have, by the measurement of the last derive(). If no measurement
  /// exists yet, returns 1 (no scaling).
  StiffnessScale max_stable_scale(const StabilityAnalysis& analysis) const noexcept;
  /// Scale of springs and dampers about the handle, 0 to 1.
  double max_stable_scale(const LocalModels::TotalGains& gains) const noexcept {
    return analysis_.max_stable_scale_at_handle(derived_ ? derivation_ : measurement_, gains);
  }
  /// The bounds for the device and delay of the last derive().
  EnergyBounds energy_bounds() const noexcept {
    return {analysis_.make_passivity_guard(derivation_), analysis_.make_work_account(derivation_)};
  }

  /// The spring at the handle in axes of H, with scale(), and the longest lag of its wrench [s].
  Matrix6d stiffness_at_handle() const noexcept {
    return analysis_.stiffness_at_handle(scale_.spring, workspace_scale_);
  }
  double longest_lag_s() const noexcept { return analysis_.longest_lag_s(derivation_); }

  /// Another rendering is active from now on.
  void set_analysis(const StabilityAnalysis& analysis) noexcept;
  /// Metres that the tool moves for a metre of the handle. Returns true if it changed; then scale() changed
  /// too.
  bool set_workspace_scale(double workspace_scale) noexcept;

 private:
  StabilityAnalysis analysis_;
  LoopMeasurement measurement_;  ///< Since start_measurement().
  LoopMeasurement derivation_;   ///< Measurement that derive() used last.
  bool derived_ = false;
  bool acknowledges_;  ///< The reports say which commands the device took.
  double workspace_scale_ = 1.0;
  StiffnessScale scale_;
};

}  // namespace wrenchd
