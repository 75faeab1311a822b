// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/inertia.hpp"
#include "core/pose.hpp"

namespace wrenchd {

/// The kinetic-energy metric of Eq. (8) between two configurations of a body, in closed form, METHOD (7)-(9).
///
/// With E = p^-1 q = (R_E, d) and (w, v) the unit quaternion of R_E, w >= 0, Eq. (12) is V~ = 2 sinh(xi^/2):
///
///   V_lin = R_E^(-1/2) d        V_ang = 2 v        |v| = sin(theta/2)
///
///   d(p, q) = T = m |x_q - x_p|^2 + 4 v' H v                                        Eq. (8), no factor 1/2
///
/// T is quadratic in (x_q - x_p, v). X_WP, X_WQ: poses of the body frame T at the centre of mass. Returns T
/// [kg m^2]. RT-safe.
double energy(const Inertia& M, const Pose& X_WP, const Pose& X_WQ) noexcept;

}  // namespace wrenchd
