// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "collision/penetration.hpp"
#include "collision/scene.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// The examples of section 4 of the paper. Its unit of length is any: the cube has sides of 50 of them, 500
/// in the larger version; the obstacle is the half-space y < 0.
Scene paper_scene(double scale);

/// p of example 4.1, Eqs. (43) and (50): the cube as it lies on the plane, turned by -0.2 rad about z.
Pose pose_of_example_4_1(double scale);

/// One step of example 4.2.
struct PaperStep {
  double time_s = 0.0;
  Pose X_WP;
  bool in_contact = false;
  Wrench F_W;  ///< on the cube about its centre of mass, in world axes
};

/// Example 4.2: the cube starts overlapping at p of Eq. (52) with the body velocity of Eq. (54), and moves
/// freely under the wrench of Eq. (16) with k_P = 1, k_I = 0.5, k_D = 0.1 for 120 steps of 0.05 s. The first
/// entry is the start, so there are 121.
std::vector<PaperStep> simulate_example_4_2(Method method);

/// What the figures of example 4.2 show, in numbers.
struct PaperSummary {
  int steps_in_contact = 0;
  double max_force_y = 0.0;   ///< of Fig. 14
  double max_torque_z = 0.0;  ///< |tau_z| of Fig. 15
};
PaperSummary summary_of(const std::vector<PaperStep>& steps);

}  // namespace wrenchd
