// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/inertia.hpp"
#include "core/pose.hpp"

namespace wrenchd {

/// State of motion of a free rigid body. B: body frame with its origin at the centre of mass.
struct BodyMotion {
  Pose X_WB;
  Vector3d velocity_W_m_per_s = Vector3d::Zero();  ///< of the centre of mass
  /// Angular momentum about the centre of mass, in axes of W [kg m^2/s]. It is constant without a torque; the
  /// angular velocity of a body with three different moments of inertia is not.
  Vector3d spin_W = Vector3d::Zero();
};

/// What acts on a body that touches nothing.
struct FreeForces {
  Vector3d gravity_W_m_per_s2 = Vector3d::Zero();
  double linear_damping_per_s = 0.0;   ///< rate at which the velocity decays, at least 0
  double angular_damping_per_s = 0.0;  ///< rate at which the angular momentum decays, at least 0
};

/// Angular velocity in W [rad/s]. RT-safe.
Vector3d angular_velocity_W(const Inertia& M, const BodyMotion& motion) noexcept;

/// Sets the angular momentum to that of the angular velocity in W [rad/s]. RT-safe.
void set_angular_velocity_W(const Inertia& M, const Vector3d& omega_W, BodyMotion& motion) noexcept;

/// Kinetic energy 1/2 m v^2 + 1/2 omega' H omega [J]. RT-safe.
double kinetic_energy_J(const Inertia& M, const BodyMotion& motion) noexcept;

/// Moves a body that touches nothing for dt_s [s], core/METHOD.md, section 15.2. Translation and angular
/// momentum are exact; the rotation has an error of fourth order in dt_s. RT-safe.
BodyMotion moved_freely(const Inertia& M, const BodyMotion& motion, const FreeForces& forces,
                        double dt_s) noexcept;

}  // namespace wrenchd
