// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "config/settings.hpp"
#include "core/device_profile.hpp"
#include "core/loop_measurement.hpp"
#include "core/passivity.hpp"
#include "core/stability_bound.hpp"
#include "daemon/servo/local_models.hpp"

namespace wrenchd {

/// How much of the spring and the damper that the configuration asks for a device can bear.
struct StiffnessScale {
  double spring = 1.0;
  double damper = 1.0;
  bool bound_known = false;  ///< the profile states the damping by which it could be computed
};

/// Holds the stiffness of the configuration against what stays passive, with the rate and the delay that were
/// measured, and against the most that the profile states.
class StabilityAnalysis {
 public:
  /// X_HT: the tool's body frame in the handle. Throws std::invalid_argument where the gains make no spring.
  StabilityAnalysis(const Settings& settings, const DeviceProfile& profile, const Inertia& M,
                    const Pose& X_HT);

  /// Where the damper costs more stiffness than it gives steadiness, it is left out. workspace_scale: metres
  /// that the tool goes for a metre of the handle, which feels the scale's square of the stiffness. RT safe.
  StiffnessScale max_stable_scale(const LoopMeasurement& measured,
                                  double workspace_scale = 1.0) const noexcept;

  /// How much of springs and brakes about the handle, each alike in all directions, stays passive: 0 to 1; 1
  /// where the profile states no damping. RT safe.
  double max_stable_scale_at_handle(const LoopMeasurement& measured,
                                    const LocalModels::TotalGains& load) const noexcept;

  /// The guard that goes with it. RT safe.
  PassivityGuard make_passivity_guard(const LoopMeasurement& measured) const noexcept;

 private:
  StiffnessScale compute_scale(const LoopDelay& loop, double workspace_scale) const;

  DeviceDamping damping_;
  EncoderStep encoder_step_;
  Coupling coupling_;
  Pose X_HT_;
  DofMask driven_;
  double period_s_;
  double max_linear_N_per_m_;  ///< the profile's own maxima
  double max_angular_Nm_per_rad_;
};

}  // namespace wrenchd
