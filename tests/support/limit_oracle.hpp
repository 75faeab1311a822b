// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "core/limits.hpp"

namespace wrenchd::test {

/// What is promised to hold, whatever a limiter does inside.
struct LimitGuarantees {
  double max_force_N = 0.0;
  double max_torque_Nm = 0.0;
  double force_ceiling_N = 0.0;
  double torque_ceiling_Nm = 0.0;
  double force_slew_N_per_s = 0.0;
  double torque_slew_Nm_per_s = 0.0;
  double workspace_radius_m = 0.0;  ///< 0: no edge
  Vector3d workspace_centre_m = Vector3d::Zero();
  double max_power_W = 0.0;  ///< 0: any
};

/// One tick of a limiter, judged from outside, in long double and without a line of its code. Returns the
/// invariant that is broken, or an empty text.
///
///   I1  what goes out is finite; an input that is not makes it zero, and is told
///   I2  each group is no longer than its maximum and its ceiling
///   I3  each group points where it was asked to, cos >= 1 - 1e-12; where the slew cut it, it lies between
///   what
///       went out last and what was asked for: out = a last + b asked, with a, b >= 0
///   I4  from some point on the way from last to zero, each group moved by no more than slew * dt
///   I5  authority 0: zero. Else no more than authority and edge leave of what was asked for
///   I6  the power into the hand is no more than its maximum
///   I7  nothing is cut for nothing: every cause told is one, and what is cut reaches the limit that cut it
std::string broken_invariant(const LimitGuarantees& promise, const Wrench& last, const LimitInput& input,
                             const Limited& out);

}  // namespace wrenchd::test
