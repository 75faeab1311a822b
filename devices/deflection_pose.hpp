// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// How firmly a cap is pushed, 0 at rest and 1 at the end of its way:
///
///   u(t) = ((|t| / full - dead_zone) / (1 - dead_zone))^curve,  cut to 0 .. 1
///
/// and so how fast it moves the pose, in the direction of t: v = gain full u. Without a stated end of the way
/// it is v = gain t. t: deflection, translation [m] or rotation vector [rad].
class SteeringCurve {
 public:
  /// full: NaN where it is not stated.
  SteeringCurve(const Deflection& settings, double gain, double full) noexcept
      : gain_(gain), full_scale_(full), dead_zone_(settings.dead_zone), curve_(settings.response_exponent) {}

  /// 0 where the end of the way is not stated. RT safe.
  double response(const Vector3d& t) const noexcept;
  /// [m/s] or [rad/s]. RT safe.
  Vector3d velocity(const Vector3d& t) const noexcept;
  /// The other way round: the deflection for a velocity, no farther than the end of the way. Less than a ten
  /// thousandth of the greatest speed is rest. RT safe.
  Vector3d deflection(const Vector3d& v) const noexcept;

 private:
  bool has_full_scale() const noexcept { return full_scale_ > 0.0; }

  double gain_, full_scale_, dead_zone_, curve_;
};

/// A pose made of how far a cap is pushed: what a six-axis mouse gives instead of a pose. B = device base,
/// H = handle point. It starts at the origin of B, and both modes never move faster than the profile's
/// speeds, nor out of the reach and the box of the profile.
///
///   rate       dp/dt = v(t),           dR/dt = v(r)^ R         t, r: deflection, in B
///   position   p -> linear_gain t,     R -> exp(angular_gain r)
///
/// In rate mode the pose may be on a leash. Nothing pushes back on the hand, so without one it would go on
/// into a wall for as long as the cap is pushed, and come back as slowly. With G the pose at which the world
/// holds the handle (it is the handle's own where nothing is in its way), e = p - p_G and d = log(R R_G'):
///
///   |e| <= leash_m f,    |d| <= leash_rad f,    f = max(u(t) cos(t, e), u(r) cos(r, d), 0)
///
/// A firmer push presses harder, as far as leash_m and leash_rad; a cap let go, or steered back, presses no
/// more, so the tool is off the wall at once. What is too far comes in at the profile's speeds.
///
/// Everything but construction is RT safe.
class DeflectionPose {
 public:
  DeflectionPose(const Deflection& settings, double max_linear_speed_m_per_s,
                 double max_angular_speed_rad_per_s)
      : settings_(settings),
        linear_(settings, settings.linear_gain, settings.full_deflection_m),
        angular_(settings, settings.angular_gain, settings.full_deflection_rad),
        max_linear_m_per_s_(max_linear_speed_m_per_s),
        max_angular_rad_per_s_(max_angular_speed_rad_per_s) {}

  /// From now on the cap is pushed this far.
  void set_deflection(const Vector3d& translation_B_m, const Vector3d& rotation_B_rad) noexcept {
    translation_m_ = translation_B_m;
    rotation_rad_ = rotation_B_rad;
  }
  /// From now on the pose goes at the profile's share of its speed, or at all of it.
  void set_slow(bool slowly) noexcept { speed_share_ = slowly ? settings_.slow_factor : 1.0; }
  /// From now on the world holds the handle there; nothing: nobody knows where, and there is no leash.
  void set_proxy_pose(const std::optional<Pose>& X_BG) noexcept { X_BQ_ = X_BG; }
  /// Leaps back to where it began.
  void recentre() noexcept { X_BH_ = {}; }
  /// Leaps there.
  void set_pose(const Pose& X_BH) noexcept { X_BH_ = X_BH; }
  /// Moves the pose on to a later time.
  void advance(double dt_s) noexcept;

  bool at_rest() const noexcept { return translation_m_.isZero(0.0) && rotation_rad_.isZero(0.0); }
  const Pose& X_BH() const noexcept { return X_BH_; }
  const Twist& V_BH() const noexcept { return V_BH_; }  ///< in the last step

 private:
  Twist commanded_twist(double dt_s) const noexcept;
  void limit_lead(const Pose& before, double dt_s) noexcept;
  void clamp_to_workspace(const Pose& before, double dt_s) noexcept;

  Deflection settings_;
  SteeringCurve linear_;
  SteeringCurve angular_;
  double max_linear_m_per_s_;
  double max_angular_rad_per_s_;
  double speed_share_ = 1.0;
  Vector3d translation_m_ = Vector3d::Zero();
  Vector3d rotation_rad_ = Vector3d::Zero();
  std::optional<Pose> X_BQ_;
  Pose X_BH_;
  Twist V_BH_;
};

}  // namespace wrenchd
