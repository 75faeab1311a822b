// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "config/settings.hpp"
#include "core/device_profile.hpp"
#include "core/loop_measurement.hpp"
#include "core/passivity.hpp"
#include "core/stability_bound.hpp"
#include "core/work_account.hpp"
#include "daemon/servo/local_models.hpp"

namespace wrenchd {

/// Factors on the configured spring and damper that keep the loop passive on a device.
struct StiffnessScale {
  double spring = 1.0;       ///< Factor on the spring, 0 to 1.
  double damper = 1.0;       ///< Factor on the damper, 0 to 1.
  bool bound_known = false;  ///< True if the profile states the damping that the bound needs.
};

/// Returns the resolution of the profile's encoders; a step that the profile does not state counts as 0.
/// RT-safe.
EncoderStep stated_encoder_step(const DeviceProfile& profile) noexcept;

/// Computes how much stiffness stays passive with the measured rate and delay of the loop, and with the
/// maximum stiffness of the profile. core/METHOD.md, section 10.
class StabilityAnalysis {
 public:
  /// M: inertia of the tool. X_HT: body frame of the tool in the handle. Throws std::invalid_argument if the
  /// gains give no valid spring. Not RT-safe: throws.
  StabilityAnalysis(const Settings& settings, const DeviceProfile& profile, const Inertia& M,
                    const Pose& X_HT);

  /// Returns the largest passive scale of spring and damper, METHOD (78). If a loop without damper allows
  /// more stiffness, the damper factor is 0. workspace_scale: metres of tool motion per metre of handle
  /// motion; the stiffness at the handle grows with its square. RT-safe.
  StiffnessScale max_stable_scale(const LoopMeasurement& measured,
                                  double workspace_scale = 1.0) const noexcept;

  /// Returns the largest passive scale of isotropic springs and dampers about the handle, METHOD (83), 0
  /// to 1. A damper on an estimated velocity counts by its energy gain. Returns 1 if the profile states no
  /// damping. RT-safe.
  double max_stable_scale_at_handle(const LoopMeasurement& measured,
                                    const LocalModels::TotalGains& gains) const noexcept;

  /// Returns the linearised spring at the handle, in axes of H, with `spring_scale` on the configured
  /// stiffness, METHOD (79), (82a). RT-safe.
  Matrix6d stiffness_at_handle(double spring_scale, double workspace_scale) const noexcept;
  /// Returns the longest time from a sample to the end of the tick in which its wrench acts [s]. RT-safe.
  double longest_lag_s(const LoopMeasurement& measured) const noexcept;

  /// Returns a passivity guard for this device and the measured delay. RT-safe.
  PassivityGuard make_passivity_guard(const LoopMeasurement& measured) const noexcept;
  /// Returns an account for external wrenches, for this device and the measured delay. RT-safe.
  WorkAccount make_work_account(const LoopMeasurement& measured) const noexcept;

 private:
  StiffnessScale compute_scale(const LoopDelay& loop, double workspace_scale) const;

  DeviceDamping damping_;
  EncoderStep encoder_step_;
  Coupling coupling_;
  Pose X_HT_;
  DofMask driven_;
  double period_s_;
  double max_linear_N_per_m_;      ///< Maximum linear stiffness of the profile; NaN if not stated.
  double max_angular_Nm_per_rad_;  ///< Maximum angular stiffness of the profile; NaN if not stated.
  double linear_velocity_gain_;    ///< Energy gain of the linear velocity: 1, or kEstimateGain.
  double angular_velocity_gain_;   ///< Energy gain of the angular velocity: 1, or kEstimateGain.
};

}  // namespace wrenchd
