// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/inertia.hpp"
#include "core/pose.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// The wrench of the potential U(p) = (k/2) T(p, q*(p)), T the energy of Eq. (8) and q* the closest
/// admissible configuration (section 5 of the method). Conservative by construction: the work around a closed
/// path of p is zero while q* is the closest point, whatever the shape of the wall.
///
/// M: of the body; k_per_s2: stiffness per mass [1/s^2], so that k m is the stiffness of a translation [N/m]
/// and k H nearly that of a small rotation [N.m/rad]. X_WP, X_WQ: poses of the body frame T at p and q.
/// In T at p, about the centre of mass, on the body, towards q. RT safe.
Wrench energy_wrench(const Inertia& M, double k_per_s2, const Pose& X_WP, const Pose& X_WQ) noexcept;

}  // namespace wrenchd
