// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// Response curve of a spring-loaded puck. The response u is 0 at rest and 1 at full deflection:
///
///   u(t) = ((|t| / full - dead_zone) / (1 - dead_zone))^exponent,  clamped to 0 .. 1
///
/// The commanded velocity in the direction of t is v = gain full u. If the full deflection is not stated, v =
/// gain t. t: deflection, translation [m] or rotation vector [rad]. All members are RT-safe.
class SteeringCurve {
 public:
  /// full: full deflection; NaN if it is not stated.
  SteeringCurve(const Deflection& settings, double gain, double full) noexcept
      : gain_(gain),
        full_scale_(full),
        dead_zone_(settings.dead_zone),
        exponent_(settings.response_exponent) {}

  /// Returns the response u(t); 0 if the full deflection is not stated. RT-safe.
  double response(const Vector3d& t) const noexcept;
  /// Returns the commanded velocity [m/s] or [rad/s]. RT-safe.
  Vector3d velocity(const Vector3d& t) const noexcept;
  /// Inverse of velocity(): returns the deflection for a velocity, clamped to the full deflection. Returns
  /// zero below 1e-4 of the maximum speed. RT-safe.
  Vector3d deflection(const Vector3d& v) const noexcept;

 private:
  bool has_full_scale() const noexcept { return full_scale_ > 0.0; }

  double gain_, full_scale_, dead_zone_, exponent_;
};

/// Pose integrated from the deflection of a puck, for devices that send no pose. B = device base, H = handle
/// frame, Q = pose of the handle at which the proxy is. The pose starts at the origin of B. In both modes it
/// respects the speed limits, the reach and the box of the profile.
///
///   rate       dp/dt = v(t),           dR/dt = v(r)^ R         t, r: deflection, in B
///   position   p -> linear_gain t,     R -> exp(angular_gain r)
///
/// In rate mode the distance to the proxy may be limited. A puck gives no force feedback, so an unlimited
/// pose would move deep into a wall and return slowly. With e = p - p_Q and d = log(R R_Q'):
///
///   |e| <= max_proxy_distance_m f,    |d| <= max_proxy_angle_rad f
///   f = max(u(t) cos(t, e), u(r) cos(r, d), 0)
///
/// A larger deflection gives a larger contact force, up to the two limits. When the deflection ends or
/// reverses, f is 0 and the pose returns to the proxy at the speed limits of the profile.
///
/// All members but the constructor are RT-safe.
class DeflectionPose {
 public:
  DeflectionPose(const Deflection& settings, double max_linear_speed_m_per_s,
                 double max_angular_speed_rad_per_s)
      : settings_(settings),
        linear_(settings, settings.linear_gain, settings.full_deflection_m),
        angular_(settings, settings.angular_gain, settings.full_deflection_rad),
        max_linear_m_per_s_(max_linear_speed_m_per_s),
        max_angular_rad_per_s_(max_angular_speed_rad_per_s) {}

  /// Sets the deflection of the puck. RT-safe.
  void set_deflection(const Vector3d& translation_B_m, const Vector3d& rotation_B_rad) noexcept {
    translation_m_ = translation_B_m;
    rotation_rad_ = rotation_B_rad;
  }
  /// Selects the reduced speed of the profile (slow_factor) or full speed. RT-safe.
  void set_slow(bool slow) noexcept { speed_factor_ = slow ? settings_.slow_factor : 1.0; }
  /// Sets the handle pose at which the proxy is. Without a pose there is no distance limit. RT-safe.
  void set_proxy_pose(const std::optional<Pose>& X_BQ) noexcept { X_BQ_ = X_BQ; }
  /// Resets the pose to the origin of B. RT-safe.
  void recentre() noexcept { X_BH_ = {}; }
  /// Sets the pose. RT-safe.
  void set_pose(const Pose& X_BH) noexcept { X_BH_ = X_BH; }
  /// Integrates the pose over dt_s. RT-safe.
  void advance(double dt_s) noexcept;

  bool at_rest() const noexcept { return translation_m_.isZero(0.0) && rotation_rad_.isZero(0.0); }
  const Pose& X_BH() const noexcept { return X_BH_; }
  const Twist& V_BH() const noexcept { return V_BH_; }  ///< twist of the last step

 private:
  Twist commanded_twist(double dt_s) const noexcept;
  void limit_proxy_distance(const Pose& before, double dt_s) noexcept;
  void clamp_to_workspace(const Pose& before, double dt_s) noexcept;

  Deflection settings_;
  SteeringCurve linear_;
  SteeringCurve angular_;
  double max_linear_m_per_s_;
  double max_angular_rad_per_s_;
  double speed_factor_ = 1.0;
  Vector3d translation_m_ = Vector3d::Zero();
  Vector3d rotation_rad_ = Vector3d::Zero();
  std::optional<Pose> X_BQ_;
  Pose X_BH_;
  Twist V_BH_;
};

}  // namespace wrenchd
