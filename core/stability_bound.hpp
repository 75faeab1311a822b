// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/device_profile.hpp"
#include "core/inertia.hpp"
#include "core/pose.hpp"

namespace wrenchd {

/// What a device takes out of a motion by itself, motors off: its viscous friction at the handle point.
struct DeviceDamping {
  double linear_N_s_per_m = DeviceProfile::kNotStated;
  double angular_Nm_s_per_rad = DeviceProfile::kNotStated;
};

/// The step of a device's encoders at the handle point: what its reports cannot tell apart. 0: none, or not
/// stated.
struct EncoderStep {
  double linear_m = 0.0;
  double angular_rad = 0.0;
};

/// What a wall may gain each time that the handle crosses the edge of a step.
inline constexpr double kMaxEnergyPerEncoderStep_J = 0.5e-6;

/// How old a pose is when its wrench acts.
struct LoopDelay {
  double period_s = 0.0;  ///< T: between two wrenches
  double delay_s = 0.0;   ///< tau: from the sample of a pose to the motors that push by it, at the longest
};

/// The spring and the damper of a wrench law, in the body frame T at its origin: [f; tau] = K [v; w].
struct Coupling {
  Matrix6d stiffness = Matrix6d::Zero();  ///< K_T [N/m, N; N, N.m/rad]
  Matrix6d damping = Matrix6d::Zero();    ///< D_T, the same times second
};

/// How much of a coupling a device can bear without giving more energy than it was given.
struct StabilityBound {
  /// The largest share of spring and damper together that stays passive, 0 to 1.
  double scale = 0.0;
  /// The same where the damper is left out altogether: often more stiffness for nothing felt.
  double scale_undamped = 0.0;
  // For people: the stiffest spring of either kind alone, the damper as it is; 0 where the damper alone is
  // too much. Infinite where it meets no driven degree of freedom.
  double max_stiffness_N_per_m = 0.0;
  double max_stiffness_Nm_per_rad = 0.0;
};

/// The largest factor s by which a sampled and delayed spring and damper remain passive:
///
///   s ( (T/2 + tau) K_H + D_H ) <= diag(b I, b_rot I)          as symmetric 6x6 matrices
///
/// K_H and D_H are K_T and D_T at the handle point, Ad' K_T Ad with Ad of X_TH (Colgate and Schenkel 1997 for
/// tau = 0; with delay Gil et al. 2004, Hulin et al. 2014, whose bounds are for stability).
///
/// Why it holds, for any force that is the gradient of a potential whose slope is at most K, walls that are
/// left included. Let x_k be the pose at tick k, d the delay in ticks. The wrench of x_(k-d) does at most
/// U_k - U_(k+1) + |dx_k|_K^2 / 2 + sum_(j=1..d) |dx_k|_K |dx_(k-j)|_K in the interval dx_k; summed over time
/// that is U at the start plus (1/2 + d) sum |dx|_K^2, and |dx|^2 <= T times the integral of v^2. A damper
/// gives at most |dx_k|_D |dx_(k-d)|_D / T, and a low pass does not add to it.
///
/// The encoders' steps are a bound of their own. Over the edge of a step the wrench jumps by step K, and acts
/// for the lag t = T/2 + tau on the wrong side of it. Over a way x it gains step K x there and the friction
/// takes b x^2 / t at least: at most (step K)^2 t / (4 b) is left, which is K step^2 / 4 where K t <= b. A
/// hand that is held on the edge has that each time; nothing but dry friction of step K / 2 takes it away
/// altogether (Abbott and Okamura 2005), and a hand cannot feel it where it is small:
///
///   s S K_H S <= 4 kMaxEnergyPerEncoderStep_J I                               S = diag(step I, step_rad I)
///
/// So virtual damping counts against passivity, not for it: at frequencies where the delay turns it round it
/// pushes. For linear stability alone it would count for, within limits; but a hand is not linear, and the
/// ledger on the plant (tests/prove) is one of energy.
///
/// X_HT: the tool's body frame in the handle. driven: along the others nothing is pushed, and only the driven
/// block of the matrices counts.
///
/// What is outside of it:
/// - A law that is no gradient. Eq. (16) is one where K_T is in proportion to the tool's mass and inertia, as
///   the projection is; an angular stiffness of six times that gives energy around closed paths at any rate.
/// - What changes the wrench after the law by more than a share of it: limits of growth that hold a wrench
///   back on the way in and not on the way out.
///
/// Throws std::invalid_argument where damping of a driven half is not stated, a number is negative or not
/// finite, T is not above 0, or K or D would pull apart. Not RT safe.
StabilityBound stability_bound(const DeviceDamping& device, const LoopDelay& loop, const Coupling& coupling,
                               const Pose& X_HT, DofMask driven = kAllDofs, const EncoderStep& step = {});

/// K of the energy law (core/energy_law.hpp), for poses close to each other: k diag(m I, H), in T.
Matrix6d energy_stiffness(const Inertia& M, double k_per_s2) noexcept;

/// The same coupling as felt at the handle point, in its axes: Ad' K Ad, symmetric part. RT safe.
Matrix6d transform_to_handle(const Matrix6d& K_T, const Pose& X_HT) noexcept;

}  // namespace wrenchd
