// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/gravity_compensation.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

#include "core/finite.hpp"

namespace wrenchd {
namespace {

/// A hand-held handle weighs less than 1 kg. A larger mass than this is a mistake of units.
constexpr double kMaxMass_kg = 20.0;
constexpr double kMaxCentreDistance_m = 1.0;
constexpr double kUnitNorm = 1e-6;  ///< tolerance on the squared norm of a quaternion with few printed digits

void check_mass(const char* which, double mass_kg) {
  if (is_finite(mass_kg) && mass_kg >= 0.0 && mass_kg <= kMaxMass_kg) return;
  throw std::invalid_argument(std::string("gravity compensation: the mass of the ") + which +
                              " must be from 0 to 20 kg");
}

}  // namespace

GravityCompensation::GravityCompensation(const MovingMasses& masses, const Quaterniond& R_WB)
    : masses_(masses) {
  check_mass("handle", masses.handle_kg);
  check_mass("carried parts", masses.carried_kg);
  if (!is_finite(masses.p_HHcm_m) || masses.p_HHcm_m.norm() > kMaxCentreDistance_m)
    throw std::invalid_argument("gravity compensation: the handle's centre of mass must be within 1 m of H");
  if (!is_finite(R_WB) || std::abs(R_WB.squaredNorm() - 1.0) > kUnitNorm)
    throw std::invalid_argument("gravity compensation: the base's tilt must be a unit quaternion");
  g_B_m_per_s2_ = R_WB.normalized().conjugate() * Vector3d(0.0, 0.0, -kGravity_m_per_s2);
}

// METHOD (89)
//
//   f = -(m_c + m_h) g_B,   tau = -(R_BH p_HHcm) x m_h g_B
Wrench GravityCompensation::wrench(const Pose& X_BH) const noexcept {
  const Vector3d lever_B = X_BH.rotation * masses_.p_HHcm_m;
  return {-(masses_.carried_kg + masses_.handle_kg) * g_B_m_per_s2_,
          -lever_B.cross(masses_.handle_kg * g_B_m_per_s2_)};
}

// METHOD (88)
//
//   U = -g_B . (m_c p_BH + m_h p_BHcm)
double GravityCompensation::potential_energy_J(const Pose& X_BH) const noexcept {
  return -g_B_m_per_s2_.dot(masses_.carried_kg * X_BH.translation_m +
                            masses_.handle_kg * (X_BH * masses_.p_HHcm_m));
}

}  // namespace wrenchd
