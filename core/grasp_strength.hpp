// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace wrenchd {

/// The largest wrench that a tool transmits to a body that it holds, about the tool's centre of mass.
struct GraspStrength {
  double force_N = 20.0;
  double torque_Nm = 2.0;
};

}  // namespace wrenchd
