// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/spatial.hpp"

namespace wrenchd {

/// The masses that a hand on the device carries around. H = handle point, C = centre of mass of the handle.
struct MovingMasses {
  double handle_kg = 0.0;                ///< what turns with the handle
  Vector3d p_HHcm_m = Vector3d::Zero();  ///< its centre of mass, in H
  /// What travels with the handle point and does not turn: a platform, the base of a gimbal. Of arms that
  /// hold it, the share that rises as far as it does: half of a rod whose other end stays.
  double carried_kg = 0.0;
};

/// Standard gravity (3rd CGPM, 1901) [m/s^2]. From equator to pole the true one differs by 0.3 % at most.
inline constexpr double kGravity_m_per_s2 = 9.80665;

/// Makes a heavy handle float: the wrench that holds the moving masses, wherever they are. B = device base,
/// W = world, z up. With the gravity g_B seen in the base,
///
///   g_B = R_WB^-1 (0, 0, -g)
///   U   = -g_B . (m_c p_BH + m_h p_BC),     p_BC = p_BH + R_BH p_HC
///
/// the wrench is the gradient of U, so that it does no work around any closed way:
///
///   f   = -(m_c + m_h) g_B                  about H, in the axes of B
///   tau = -(R_BH p_HC) x m_h g_B
///
/// It holds what stands still and adds no stiffness; it is no brake, and once the motors are off the handle
/// is as heavy as it is. It counts against the profile's limits like any other wrench.
class GravityCompensation {
 public:
  /// R_WB: how the base stands, from its mounting or a level. Throws std::invalid_argument where a mass or a
  /// centre cannot be (below 0, above 20 kg, farther than 1 m), or R_WB is no rotation.
  GravityCompensation(const MovingMasses& masses, const Quaterniond& R_WB);

  /// On the hand, about the handle point, in the axes of the base: as a device takes it. RT safe.
  Wrench wrench(const Pose& X_BH) const noexcept;
  /// U [J], zero where the masses are at the origin of B. RT safe.
  double potential_energy_J(const Pose& X_BH) const noexcept;

 private:
  MovingMasses masses_;
  Vector3d g_B_m_per_s2_;
};

}  // namespace wrenchd
