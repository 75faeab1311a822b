// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/spatial.hpp"

namespace wrenchd {

/// Moving masses of a device as the hand carries them. H: handle point, Hcm: centre of mass of the handle.
struct MovingMasses {
  double handle_kg = 0.0;                ///< mass of the parts that rotate with the handle
  Vector3d p_HHcm_m = Vector3d::Zero();  ///< centre of mass of the handle, in H
  /// Mass of the parts that translate with the handle point and do not rotate: a platform, the base of a
  /// gimbal. A rod with one fixed end counts with half of its mass.
  double carried_kg = 0.0;
};

/// Standard gravity (3rd CGPM, 1901) [m/s^2]. The true value differs by at most 0.3 % between equator and
/// poles.
inline constexpr double kGravity_m_per_s2 = 9.80665;

/// Gravity compensation: the wrench that balances the weight of the moving masses at any handle pose. B:
/// device base, W: world, z up. g_B: gravity in base axes. METHOD (88), (89):
///
///   g_B = R_WB^-1 (0, 0, -g)
///   U   = -g_B . (m_c p_BH + m_h p_BHcm),     p_BHcm = p_BH + R_BH p_HHcm
///   f   = -(m_c + m_h) g_B                  about H, in the axes of B
///   tau = -(R_BH p_HHcm) x m_h g_B
///
/// The wrench is the gradient of U, so its work around a closed path is zero. It adds no stiffness and no
/// damping. The profile's limits apply to it as to any other wrench.
class GravityCompensation {
 public:
  /// R_WB: orientation of the base in the world, from its mounting or a level. Throws std::invalid_argument
  /// if a mass is not within 0 to 20 kg, the centre of mass is farther than 1 m from H, or R_WB is not a unit
  /// quaternion.
  GravityCompensation(const MovingMasses& masses, const Quaterniond& R_WB);

  /// Compensating wrench on the hand, about the handle point, in the axes of the base. RT-safe.
  Wrench wrench(const Pose& X_BH) const noexcept;
  /// Potential energy U [J]; zero for masses at the origin of B. RT-safe.
  double potential_energy_J(const Pose& X_BH) const noexcept;

 private:
  MovingMasses masses_;
  Vector3d g_B_m_per_s2_;
};

}  // namespace wrenchd
