// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/limits.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/finite.hpp"

namespace wrenchd {
namespace {

double tighter(double setting, double profile) {
  return setting > 0.0 ? std::min(setting, profile) : profile;
}

/// Shortens v to the limit, direction kept, and stays below it by what rounding may add. Taken apart into its
/// largest component and the rest, because the length of a finite vector may be infinite.
bool saturate(Vector3d& v, double limit) noexcept {
  constexpr double kBelow = 1.0 - 4.0 * std::numeric_limits<double>::epsilon();
  const double largest = v.cwiseAbs().maxCoeff();
  if (!(largest > 0.0)) return false;
  const Vector3d shape = v / largest;
  const double longest = limit / shape.norm();
  if (!(largest > longest)) return false;
  v = shape * (kBelow * longest);
  return true;
}

/// Lets v grow from what went out last by at most `growth`; shrinking along the last direction is free.
///
///   keep = the part of v along last, between 0 and |last|        (free)
///   rest = v - keep                                              (new: at most `growth` long)
bool slew(Vector3d& v, const Vector3d& last, double growth) noexcept {
  const double last_length = last.norm();
  Vector3d keep = Vector3d::Zero();
  if (last_length > 0.0)
    keep = last * (std::clamp(v.dot(last) / last_length, 0.0, last_length) / last_length);
  const Vector3d rest = v - keep;
  const double length = rest.norm();
  if (!(length > growth)) return false;
  v = keep + rest * (growth / length);
  return true;
}

}  // namespace

WrenchLimits::WrenchLimits(const LimitSettings& settings, double profile_max_force_N,
                           double profile_max_torque_Nm)
    : max_force_N_(tighter(settings.max_force_N, profile_max_force_N)),
      max_torque_Nm_(tighter(settings.max_torque_Nm, profile_max_torque_Nm)),
      force_slew_N_per_s_(settings.force_slew_N_per_s),
      torque_slew_Nm_per_s_(settings.torque_slew_Nm_per_s) {}

Limited WrenchLimits::apply(const Wrench& asked, double authority, double dt_s) noexcept {
  if (!is_finite(asked) || !is_finite(authority) || !is_finite(dt_s)) {
    reset();
    return {Wrench{}, kNotFinite};
  }
  Limited out{asked, kNotLimited};
  const auto mark = [&out](bool cut, LimitCause cause) noexcept {
    if (cut) out.causes = static_cast<std::uint8_t>(out.causes | cause);
  };
  mark(saturate(out.F.force_N, max_force_N_), kForceMagnitude);
  mark(saturate(out.F.torque_Nm, max_torque_Nm_), kTorqueMagnitude);

  const double share = std::clamp(authority, 0.0, 1.0);
  mark(share < 1.0, kAuthority);
  out.F.force_N *= share;
  out.F.torque_Nm *= share;

  const double dt = std::max(dt_s, 0.0);
  mark(slew(out.F.force_N, last_.force_N, force_slew_N_per_s_ * dt), kForceSlew);
  mark(slew(out.F.torque_Nm, last_.torque_Nm, torque_slew_Nm_per_s_ * dt), kTorqueSlew);
  // Between two vectors within the limit lies no longer one, but for rounding.
  saturate(out.F.force_N, max_force_N_);
  saturate(out.F.torque_Nm, max_torque_Nm_);
  last_ = out.F;
  return out;
}

}  // namespace wrenchd
