// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "core/limits.hpp"

namespace wrenchd::test {

/// Guarantees of a limiter, independent of its implementation.
struct LimitGuarantees {
  double max_force_N = 0.0;
  double max_torque_Nm = 0.0;
  double force_ceiling_N = 0.0;
  double torque_ceiling_Nm = 0.0;
  double force_slew_N_per_s = 0.0;
  double torque_slew_Nm_per_s = 0.0;
  double workspace_radius_m = 0.0;  ///< 0: unlimited
  Vector3d workspace_centre_m = Vector3d::Zero();
  double max_power_W = 0.0;  ///< 0: unlimited
};

/// Judges one tick of a limiter from outside, in long double and without the limiter's code. Returns the
/// violated invariant, or an empty text.
///
///   I1  the output is finite; an input that is not finite makes it zero and is reported
///   I2  each group is within its maximum and its ceiling
///   I3  each group points in the requested direction, cos >= 1 - 1e-12; if the slew limit acts, the output
///   is
///       between the previous output and the request: out = a last + b requested, with a, b >= 0
///   I4  from some point between the previous output and zero, each group changes by at most slew * dt
///   I5  authority 0 gives zero. Otherwise the output is at most authority times edge factor times the
///   request I6  the power into the hand is at most its maximum I7  no group is limited without cause: every
///   reported cause applies, and a limited group reaches the limit that acts
std::string broken_invariant(const LimitGuarantees& promise, const Wrench& last, const LimitInput& input,
                             const Limited& out);

}  // namespace wrenchd::test
