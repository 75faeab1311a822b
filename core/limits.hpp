// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/spatial.hpp"

namespace wrenchd {

/// What the daemon's configuration says of limits. It may tighten a profile's limits, never loosen them.
struct LimitSettings {
  double max_force_N = 0.0;  ///< 0: the profile's own
  double max_torque_Nm = 0.0;
  double force_slew_N_per_s = 2000.0;  ///< growth only; towards zero is free
  double torque_slew_Nm_per_s = 50.0;
  double soft_start_s = 1.0;  ///< from armed to full authority
};

/// Why a wrench that goes out is not the one the law asked for. A bit mask.
enum LimitCause : std::uint8_t {
  kNotLimited = 0,
  kForceMagnitude = 1,
  kTorqueMagnitude = 2,
  kForceSlew = 4,
  kTorqueSlew = 8,
  kAuthority = 16,  ///< soft start or a stale sample: less than full authority
  kNotFinite = 32,  ///< NaN or infinity: zero goes out
};

struct Limited {
  Wrench F;
  std::uint8_t causes = kNotLimited;
};

/// The last thing between the rendering and the device, in this order: not finite -> zero; magnitude, force
/// and torque each as a group, direction kept; authority; slew of what grows, from what went out last.
///
/// Whatever came before, legal or not, what goes out is finite and within the magnitudes.
class WrenchLimits {
 public:
  /// The tighter of the two applies. Both maxima must be finite; 0: the device has no motors for it.
  WrenchLimits(const LimitSettings& settings, double profile_max_force_N, double profile_max_torque_Nm);

  /// authority: 0 to 1, scales what is asked for. dt_s: time since the last call. RT safe.
  Limited apply(const Wrench& asked, double authority, double dt_s) noexcept;

  /// Nothing goes out any more: the next wrench grows from zero. RT safe.
  void reset() noexcept { last_ = Wrench{}; }

  double max_force_N() const noexcept { return max_force_N_; }
  double max_torque_Nm() const noexcept { return max_torque_Nm_; }

 private:
  double max_force_N_;
  double max_torque_Nm_;
  double force_slew_N_per_s_;
  double torque_slew_Nm_per_s_;
  Wrench last_;
};

}  // namespace wrenchd
