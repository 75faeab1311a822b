// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/spatial.hpp"

namespace wrenchd {

/// Gains of Eq. (16), in the body frame T at the centre of mass: [f; tau] = K [v; w].
struct WrenchGains {
  Matrix6d stiffness = Matrix6d::Zero();  ///< K_P  [N/m, N; N, N.m/rad]
  Matrix6d integral = Matrix6d::Zero();   ///< K_I  the same per second
  Matrix6d damping = Matrix6d::Zero();    ///< K_D  the same times second
  double integral_limit_N = 1.0;          ///< anti-windup: the most force that K_I may contribute
  double integral_limit_Nm = 0.05;        ///< and the most torque
  double derivative_cutoff_Hz = 100.0;    ///< first-order low pass on d eps/dt
};

}  // namespace wrenchd
