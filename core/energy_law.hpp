// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/inertia.hpp"
#include "core/pose.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// Wrench of the potential U(p) = (k/2) T(p, q*(p)), core/METHOD.md, section 8.2. T is the energy of Eq. (8),
/// q* the closest admissible configuration. The wrench is conservative: while q* is the closest point, the
/// work around a closed path of p is zero for every obstacle shape.
///
/// M: inertia of the body. k_per_s2: stiffness per mass [1/s^2]; k m is the translational stiffness [N/m],
/// and k H approximates the rotational stiffness [N.m/rad]. X_WP, X_WQ: poses of the body frame T at p and q.
/// Returns the wrench on the body about the centre of mass, in T at p; it pulls towards q. RT-safe.
Wrench energy_wrench(const Inertia& M, double k_per_s2, const Pose& X_WP, const Pose& X_WQ) noexcept;

}  // namespace wrenchd
