// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// A pose made of how far a cap is pushed: what a six-axis mouse gives instead of a pose. B = device base,
/// H = handle point. It starts at the origin of B, and both modes never move faster than the profile's
/// speeds.
///
///   rate       dp/dt = linear_gain t,     dR/dt = (angular_gain r)^ R        t, r: deflection, in B
///   position   p -> linear_gain t,        R -> exp(angular_gain r)
///
/// Everything but construction is RT safe.
class DeflectionPose {
 public:
  DeflectionPose(const Deflection& settings, double max_linear_speed_m_per_s,
                 double max_angular_speed_rad_per_s)
      : settings_(settings),
        max_linear_m_per_s_(max_linear_speed_m_per_s),
        max_angular_rad_per_s_(max_angular_speed_rad_per_s) {}

  /// From now on the cap is pushed this far.
  void push(const Vector3d& translation_B_m, const Vector3d& rotation_B_rad) noexcept {
    translation_m_ = translation_B_m;
    rotation_rad_ = rotation_B_rad;
  }
  /// Moves the pose on to a later time.
  void advance(double dt_s) noexcept;

  bool at_rest() const noexcept { return translation_m_.isZero(0.0) && rotation_rad_.isZero(0.0); }
  const Pose& X_BH() const noexcept { return X_BH_; }
  const Twist& V_BH() const noexcept { return V_BH_; }  ///< in the last step

 private:
  Twist wanted(double dt_s) const noexcept;

  Deflection settings_;
  double max_linear_m_per_s_;
  double max_angular_rad_per_s_;
  Vector3d translation_m_ = Vector3d::Zero();
  Vector3d rotation_rad_ = Vector3d::Zero();
  Pose X_BH_;
  Twist V_BH_;
};

}  // namespace wrenchd
