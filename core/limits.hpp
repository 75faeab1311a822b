// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>

#include "core/spatial.hpp"

namespace wrenchd {

struct DeviceProfile;

/// What the daemon's configuration says of limits. It may tighten a profile's limits, never loosen them.
struct LimitSettings {
  double max_force_N = 0.0;  ///< 0: the profile's own
  double max_torque_Nm = 0.0;
  double force_slew_N_per_s = 2000.0;  ///< growth only; towards zero is free
  double torque_slew_Nm_per_s = 50.0;
  double soft_start_s = 1.0;  ///< from armed to full authority
};

/// Of each limit the tighter one: no more than either of them lets go out with this profile. RT safe.
LimitSettings tighter(const LimitSettings& a, const LimitSettings& b, const DeviceProfile& profile) noexcept;

/// No profile and no setting reaches further, whatever they say.
inline constexpr double kAbsoluteMaxForce_N = 200.0;
inline constexpr double kAbsoluteMaxTorque_Nm = 20.0;

/// Growth is never made up for: a longer step counts as this one. Five periods of the slowest loop.
inline constexpr double kMaxStep_s = 0.010;

/// Outside the workspace the wrench fades; at this many radii it is zero.
inline constexpr double kWorkspaceFadeEnd = 1.1;

/// Why a wrench that goes out is not the one the law asked for. A bit mask.
enum LimitCause : std::uint16_t {
  kNotLimited = 0,
  kForceMagnitude = 1,
  kTorqueMagnitude = 2,
  kForceSlew = 4,
  kTorqueSlew = 8,
  kAuthority = 16,     ///< soft start or a stale sample: less than full authority
  kNotFinite = 32,     ///< NaN or infinity: zero goes out
  kForceThermal = 64,  ///< the motors are warm: less than the maximum
  kTorqueThermal = 128,
  kWorkspaceEdge = 256,  ///< the handle is outside of its workspace
  kPower = 512,          ///< more power would go into the hand than may
  kPassivity = 1024,     ///< the passivity guard took from it before any of these
};

/// "force magnitude", "power"; of one bit.
const char* text(LimitCause cause) noexcept;

/// The causes of a mask, as in "force magnitude, power"; "none". Not RT safe.
std::string limit_causes_text(std::uint16_t causes);

/// What a tick asks for, and where the hand is; all in axes of the base B, about the handle point H.
struct LimitInput {
  Wrench requested;
  double authority = 0.0;              ///< scales what is asked for: 0 to 1
  double dt_s = 0.0;                   ///< since the last call
  Twist V_BH;                          ///< of the handle
  Vector3d p_BH_m = Vector3d::Zero();  ///< the handle point
};

struct Limited {
  Wrench F;
  std::uint16_t causes = kNotLimited;  ///< LimitCause bits
};

/// The last thing between the rendering and the device, in this order:
///
///   not finite, any number of the input: zero goes out
///   magnitude, force and torque each as a group, direction kept
///   thermal ceiling, likewise: below the magnitude while motors are warm
///   workspace edge: the wrench fades outside
///   authority
///   slew: what grows, from what went out last; towards zero is free
///   power: the whole wrench by one factor; what brakes the hand is free
///
/// Power comes after the slew, which holds back force and torque each on its own: one of them may have been
/// what kept the power of the other down. A scale for both keeps all that was promised before it.
///
/// Whatever came before, legal or not, what goes out is finite and within every limit.
class WrenchLimits {
 public:
  /// The tighter of settings and profile applies. A maximum that is not stated is 0: no force. Edge and power
  /// that are not stated are no limits. Slew rates that are no positive numbers let nothing grow.
  WrenchLimits(const LimitSettings& settings, const DeviceProfile& profile);

  /// RT safe.
  Limited apply(const LimitInput& input) noexcept;

  /// What the motors bear now, of each group; never above the maxima. What is not finite is 0. RT safe.
  void set_ceiling(double force_N, double torque_Nm) noexcept;

  /// Nothing goes out any more: the next wrench grows from zero. RT safe.
  void reset() noexcept { last_sent_ = Wrench{}; }

  /// Other settings from here on, though what went out last stays what it was. RT safe.
  void set_limits(const LimitSettings& settings, const DeviceProfile& profile) noexcept;

  /// What went out last is this, though it did not come from here: the next wrench grows from it. RT safe.
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
  double workspace_radius_m_;  ///< NaN: no edge
  Vector3d workspace_centre_m_;
  double max_power_W_;  ///< NaN: any
  Wrench last_sent_;
};

}  // namespace wrenchd
