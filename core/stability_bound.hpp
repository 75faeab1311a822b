// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/device_profile.hpp"
#include "core/inertia.hpp"
#include "core/pose.hpp"

namespace wrenchd {

/// Viscous friction of a device at the handle point with the motors off.
struct DeviceDamping {
  double linear_N_s_per_m = DeviceProfile::kNotStated;
  double angular_Nm_s_per_rad = DeviceProfile::kNotStated;
};

/// Resolution of a device's encoders at the handle point. 0: exact, or not stated.
struct EncoderStep {
  double linear_m = 0.0;
  double angular_rad = 0.0;
};

/// Energy that a wall may inject each time the handle crosses the boundary of an encoder step.
inline constexpr double kMaxEnergyPerEncoderStep_J = 0.5e-6;

/// Sampling period and delay of the servo loop.
struct LoopDelay {
  double period_s = 0.0;  ///< T: time between two wrenches
  double delay_s = 0.0;   ///< tau: longest delay from the pose sample to the motors
};

/// Virtual coupling: spring and damper of a wrench law, in the body frame T at its origin: [f; tau] = K [v;
/// w].
struct Coupling {
  Matrix6d stiffness = Matrix6d::Zero();  ///< K_T [N/m, N; N, N.m/rad]
  Matrix6d damping = Matrix6d::Zero();    ///< D_T [N.s/m, N.s; N.s, N.m.s/rad]
};

/// Largest coupling that remains passive on a device.
struct StabilityBound {
  /// Largest scale on spring and damper together that remains passive, 0 to 1.
  double scale = 0.0;
  /// Largest scale on the spring without the damper, 0 to 1; often larger than `scale`.
  double scale_undamped = 0.0;
  // For display: the largest translational or rotational stiffness alone, next to the unscaled damper. 0 if
  // the damper alone exceeds the bound. Infinite without a driven degree of freedom.
  double max_stiffness_N_per_m = 0.0;
  double max_stiffness_Nm_per_rad = 0.0;
};

/// The largest factor s for which a sampled and delayed spring and damper remain passive, METHOD (78), (82):
///
///   s ( (T/2 + tau) K_H + D_H ) <= diag(b I, b_rot I)          as symmetric 6x6 matrices
///   s S K_H S <= 4 kMaxEnergyPerEncoderStep_J I                S = diag(step I, step_rad I)
///
/// K_H, D_H: K_T and D_T at the handle point. The virtual damper counts against passivity, because its force
/// is delayed. Derivation, sources and what the bound does not cover: core/METHOD.md, section 10.
///
/// X_HT: tool body frame in the handle frame. driven: only this block of the matrices counts. Throws
/// std::invalid_argument if the damping of a driven half is not stated, a number is negative or not finite, T
/// is not positive, or K or D has a negative eigenvalue. Not RT-safe: solves eigenvalue problems.
StabilityBound stability_bound(const DeviceDamping& device, const LoopDelay& loop, const Coupling& coupling,
                               const Pose& X_HT, DofMask driven = kAllDofs, const EncoderStep& step = {});

/// Stiffness of the energy law (core/energy_law.hpp) for small displacements: k diag(m I, H), in T, METHOD
/// (65). RT-safe.
Matrix6d energy_stiffness(const Inertia& M, double k_per_s2) noexcept;

/// Stiffness or damping matrix at the handle point, in handle axes: Ad' K Ad, symmetric part, METHOD (79).
/// RT-safe.
Matrix6d transform_to_handle(const Matrix6d& K_T, const Pose& X_HT) noexcept;

}  // namespace wrenchd
