// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>

#include "core/spatial.hpp"

namespace wrenchd {

struct DeviceProfile;

/// [limits] of the configuration. Each value tightens the limit of the device profile; none can raise it.
struct LimitSettings {
  double max_force_N = 0.0;  ///< 0: the profile's limit applies
  double max_torque_Nm = 0.0;
  double force_slew_N_per_s = 2000.0;  ///< limit on the growth of the force; a decrease is not limited
  double torque_slew_Nm_per_s = 50.0;
  double soft_start_s = 1.0;  ///< duration of the ramp from armed to full authority
};

/// The tighter of two settings, limit by limit, for this profile. RT-safe.
LimitSettings tighter(const LimitSettings& a, const LimitSettings& b, const DeviceProfile& profile) noexcept;

/// Upper limit of any profile or setting.
inline constexpr double kAbsoluteMaxForce_N = 200.0;
inline constexpr double kAbsoluteMaxTorque_Nm = 20.0;

/// Upper limit of the time step in the slew limit: growth that a late tick missed is not made up. Five
/// periods of the slowest loop.
inline constexpr double kMaxStep_s = 0.010;

/// Distance from the workspace centre, in radii, at which the wrench has faded to zero.
inline constexpr double kWorkspaceFadeEnd = 1.1;

/// Reasons why the wrench sent differs from the wrench requested. A bit mask.
enum LimitCause : std::uint16_t {
  kNotLimited = 0,
  kForceMagnitude = 1,
  kTorqueMagnitude = 2,
  kForceSlew = 4,
  kTorqueSlew = 8,
  kAuthority = 16,     ///< authority below 1: soft start or a stale sample
  kNotFinite = 32,     ///< an input contains NaN or infinity: zero is sent
  kForceThermal = 64,  ///< the motors are warm: the force ceiling is below the maximum
  kTorqueThermal = 128,
  kWorkspaceEdge = 256,  ///< the handle is outside of its workspace
  kPower = 512,          ///< the power into the hand would exceed its limit
  kPassivity = 1024,     ///< the passivity guard reduced the wrench before the limits
};

/// Name of one cause, for example "force magnitude". RT-safe.
const char* text(LimitCause cause) noexcept;

/// Requested wrench and handle motion in a tick; in axes of the device base B, about the handle point H.
struct LimitInput {
  Wrench requested;
  double authority = 0.0;              ///< factor on the requested wrench, 0 to 1
  double dt_s = 0.0;                   ///< time since the previous call
  Twist V_BH;                          ///< twist of the handle in B
  Vector3d p_BH_m = Vector3d::Zero();  ///< position of the handle point in B
};

struct Limited {
  Wrench F;
  std::uint16_t causes = kNotLimited;  ///< bit mask of LimitCause
};

/// Final limits between rendering and device. apply() runs these steps in this order:
///
///   finite      any input that is not finite: sends zero
///   magnitude   clamps the lengths of force and torque, keeps their directions
///   thermal     clamps the lengths to the current ceilings, which are lower while the motors are warm
///   workspace   fades the wrench outside of the workspace
///   authority   scales the wrench
///   slew        limits the growth from the last wrench; a decrease is not limited
///   power       scales the whole wrench if it puts too much power into the hand; braking is not limited
///
/// Power follows slew, because slew limits force and torque separately and so can raise the total power. One
/// scale on both preserves all earlier limits. Every wrench returned is finite and within all limits, for any
/// input.
class WrenchLimits {
 public:
  /// Applies the tighter of settings and profile. A maximum that is not stated is 0. A workspace or power
  /// that is not stated sets no limit. A slew rate that is not positive allows no growth.
  WrenchLimits(const LimitSettings& settings, const DeviceProfile& profile);

  /// Limits the requested wrench and stores the result as the last wrench sent. RT-safe.
  Limited apply(const LimitInput& input) noexcept;

  /// Sets the force and torque that the motors currently sustain; clamped to the maxima. A value that is not
  /// finite sets 0. RT-safe.
  void set_ceiling(double force_N, double torque_Nm) noexcept;

  /// Sets the last wrench to zero: the next wrench grows from zero. RT-safe.
  void reset() noexcept { last_sent_ = Wrench{}; }

  /// Replaces the settings and keeps the last wrench. RT-safe.
  void set_limits(const LimitSettings& settings, const DeviceProfile& profile) noexcept;

  /// Sets the last wrench to one that was sent without apply(); the next wrench grows from it. RT-safe.
  void set_last_sent(const Wrench& last) noexcept { last_sent_ = last; }

  double max_force_N() const noexcept { return max_force_N_; }
  double max_torque_Nm() const noexcept { return max_torque_Nm_; }

 private:
  double workspace_scale(const Vector3d& p_BH_m) const noexcept;
  double power_scale(const Wrench& F, const Twist& V_BH) const noexcept;

  double max_force_N_;
  double max_torque_Nm_;
  double force_ceiling_N_;
  double torque_ceiling_Nm_;
  double force_slew_N_per_s_;
  double torque_slew_Nm_per_s_;
  double workspace_radius_m_;  ///< NaN: no workspace limit
  Vector3d workspace_centre_m_;
  double max_power_W_;  ///< NaN: no power limit
  Wrench last_sent_;
};

}  // namespace wrenchd
