// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/limits.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/device_profile.hpp"
#include "core/finite.hpp"

namespace wrenchd {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kRoundDown =
    1.0 - 4.0 * kEpsilon;  ///< keeps a product below its limit if rounding increases it

/// x clamped to 0 ... `most`; 0 if x is not finite.
double clamped(double x, double most) noexcept {
  return is_finite(x) ? std::clamp(x, 0.0, most) : 0.0;
}

/// The smaller of a setting and the profile's value. A setting that is 0 or not finite selects the profile's
/// value. A profile value that is not stated gives 0.
double tighter_of(double setting, double profile, double absolute_max) noexcept {
  const double profile_limit = clamped(profile, absolute_max);
  return is_finite(setting) && setting > 0.0 ? std::min(setting, profile_limit) : profile_limit;
}

/// Clamps the length of v to the limit and keeps the direction. Returns true if it changed v. Divides by the
/// largest component first, because the length of a finite vector may overflow.
bool clamp_length(Vector3d& v, double limit) noexcept {
  const double largest = v.cwiseAbs().maxCoeff();
  if (!(largest > 0.0)) return false;
  const Vector3d shape = v / largest;
  const double longest = limit / shape.norm();
  if (!(largest > longest)) return false;
  v = shape * (kRoundDown * longest);
  return true;
}

/// Limits the growth of v relative to the last wrench; a decrease along the last direction is not limited.
/// Returns true if it changed v.
///
///   keep = component of v along last, clamped to 0 ... |last|
///   rest = v - keep                                              clamped to the length `growth`
bool clamp_growth(Vector3d& v, const Vector3d& last, double growth) noexcept {
  const double last_length = last.norm();
  Vector3d keep = Vector3d::Zero();
  if (last_length > 0.0) {
    const Vector3d along = last / last_length;
    keep = along * std::clamp(v.dot(along), 0.0, last_length);
  }
  const Vector3d rest = v - keep;
  const double rest_length = rest.norm();
  if (!(rest_length > growth)) return false;
  v = keep + rest * (growth / rest_length);
  return true;
}

/// The last wrench, clamped to the limit; zero if it is not finite.
Vector3d clamped_last(const Vector3d& last, double limit) noexcept {
  if (!is_finite(last)) return Vector3d::Zero();
  Vector3d v = last;
  clamp_length(v, limit);
  return v;
}

bool all_finite(const LimitInput& in) noexcept {
  return is_finite(in.requested) && is_finite(in.authority) && is_finite(in.dt_s) && is_finite(in.V_BH) &&
         is_finite(in.p_BH_m);
}

}  // namespace

LimitSettings tighter(const LimitSettings& a, const LimitSettings& b, const DeviceProfile& profile) noexcept {
  const auto least = [](double x, double y, double profile_limit, double absolute_max) {
    return tighter_of(x, profile_limit, absolute_max) <= tighter_of(y, profile_limit, absolute_max) ? x : y;
  };
  LimitSettings both;
  both.max_force_N = least(a.max_force_N, b.max_force_N, profile.max_force_N, kAbsoluteMaxForce_N);
  both.max_torque_Nm = least(a.max_torque_Nm, b.max_torque_Nm, profile.max_torque_Nm, kAbsoluteMaxTorque_Nm);
  both.force_slew_N_per_s = std::min(a.force_slew_N_per_s, b.force_slew_N_per_s);
  both.torque_slew_Nm_per_s = std::min(a.torque_slew_Nm_per_s, b.torque_slew_Nm_per_s);
  both.soft_start_s = std::max(a.soft_start_s, b.soft_start_s);
  return both;
}

const char* text(LimitCause cause) noexcept {
  switch (cause) {
    case kNotLimited:
      return "none";
    case kForceMagnitude:
      return "force magnitude";
    case kTorqueMagnitude:
      return "torque magnitude";
    case kForceSlew:
      return "force clamp_growth";
    case kTorqueSlew:
      return "torque clamp_growth";
    case kAuthority:
      return "authority";
    case kNotFinite:
      return "not finite";
    case kForceThermal:
      return "force thermal";
    case kTorqueThermal:
      return "torque thermal";
    case kWorkspaceEdge:
      return "workspace edge";
    case kPower:
      return "power";
    case kPassivity:
      return "passivity";
  }
  return "unknown";
}

WrenchLimits::WrenchLimits(const LimitSettings& settings, const DeviceProfile& profile)
    : max_force_N_(tighter_of(settings.max_force_N, profile.max_force_N, kAbsoluteMaxForce_N)),
      max_torque_Nm_(tighter_of(settings.max_torque_Nm, profile.max_torque_Nm, kAbsoluteMaxTorque_Nm)),
      force_ceiling_N_(max_force_N_),
      torque_ceiling_Nm_(max_torque_Nm_),
      force_slew_N_per_s_(clamped(settings.force_slew_N_per_s, std::numeric_limits<double>::max())),
      torque_slew_Nm_per_s_(clamped(settings.torque_slew_Nm_per_s, std::numeric_limits<double>::max())),
      workspace_radius_m_(profile.workspace_radius_m),
      workspace_centre_m_(profile.workspace_centre_m),
      max_power_W_(profile.max_power_W) {}

void WrenchLimits::set_limits(const LimitSettings& settings, const DeviceProfile& profile) noexcept {
  const Wrench last = last_sent_;
  *this = WrenchLimits(settings, profile);
  last_sent_ = last;
}

void WrenchLimits::set_ceiling(double force_N, double torque_Nm) noexcept {
  force_ceiling_N_ = clamped(force_N, max_force_N_);
  torque_ceiling_Nm_ = clamped(torque_Nm, max_torque_Nm_);
}

/// 1 inside of the workspace radius; decreases linearly to 0 at kWorkspaceFadeEnd radii.
double WrenchLimits::workspace_scale(const Vector3d& p_BH_m) const noexcept {
  if (!is_finite(workspace_radius_m_)) return 1.0;
  const double distance_m = (p_BH_m - workspace_centre_m_).norm();
  if (distance_m <= workspace_radius_m_) return 1.0;
  const double end_m = kWorkspaceFadeEnd * workspace_radius_m_;
  if (!(distance_m < end_m)) return 0.0;
  return (end_m - distance_m) / (end_m - workspace_radius_m_);
}

/// Factor on the wrench that limits the power into the hand to max_power_W.
///
///   P = f . v + tau . w + bound of its rounding
///
/// Divides the twist by its largest component first, because P may overflow.
double WrenchLimits::power_scale(const Wrench& F, const Twist& V) const noexcept {
  if (!is_finite(max_power_W_)) return 1.0;
  const double largest =
      std::max(V.linear_m_per_s.cwiseAbs().maxCoeff(), V.angular_rad_per_s.cwiseAbs().maxCoeff());
  if (!(largest > 0.0)) return 1.0;
  const Vector3d linear = F.force_N.cwiseProduct(V.linear_m_per_s / largest);
  const Vector3d angular = F.torque_Nm.cwiseProduct(V.angular_rad_per_s / largest);
  const double rounding = 8.0 * kEpsilon * (linear.lpNorm<1>() + angular.lpNorm<1>());
  const double power = linear.sum() + angular.sum() + rounding;
  if (!(power > 0.0)) return 1.0;
  const double most = std::max(max_power_W_, 0.0) / power;
  return largest > most ? kRoundDown * (most / largest) : 1.0;
}

Limited WrenchLimits::apply(const LimitInput& in) noexcept {
  if (!all_finite(in)) {
    reset();
    return {Wrench{}, kNotFinite};
  }
  Limited out{in.requested, kNotLimited};
  Vector3d &force_N = out.F.force_N, &torque_Nm = out.F.torque_Nm;
  const auto mark = [&out](bool cut, LimitCause cause) noexcept {
    if (cut) out.causes = static_cast<std::uint16_t>(out.causes | cause);
  };
  const auto scale = [&](double share, LimitCause cause) noexcept {
    mark(share < 1.0, cause);
    force_N *= share;
    torque_Nm *= share;
  };
  mark(clamp_length(force_N, max_force_N_), kForceMagnitude);
  mark(clamp_length(torque_Nm, max_torque_Nm_), kTorqueMagnitude);
  mark(clamp_length(force_N, force_ceiling_N_), kForceThermal);
  mark(clamp_length(torque_Nm, torque_ceiling_Nm_), kTorqueThermal);
  scale(workspace_scale(in.p_BH_m), kWorkspaceEdge);
  scale(std::clamp(in.authority, 0.0, 1.0), kAuthority);

  const double dt_s = std::clamp(in.dt_s, 0.0, kMaxStep_s);
  mark(clamp_growth(force_N, clamped_last(last_sent_.force_N, max_force_N_), force_slew_N_per_s_ * dt_s),
       kForceSlew);
  mark(clamp_growth(torque_Nm, clamped_last(last_sent_.torque_Nm, max_torque_Nm_),
                    torque_slew_Nm_per_s_ * dt_s),
       kTorqueSlew);
  // A vector between two vectors within the limit is within the limit, up to rounding.
  clamp_length(force_N, force_ceiling_N_);
  clamp_length(torque_Nm, torque_ceiling_Nm_);
  scale(power_scale(out.F, in.V_BH), kPower);
  last_sent_ = out.F;
  return out;
}

}  // namespace wrenchd
