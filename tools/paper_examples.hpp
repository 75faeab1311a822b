// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "collision/penetration.hpp"
#include "collision/scene.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// The scene of the examples in the paper, section 4. The unit of length is arbitrary: the cube's side is 50
/// units, or 500 in the larger version. The obstacle is the half-space y < 0. Not RT-safe: allocates.
Scene paper_scene(double scale);

/// Returns p of the paper, example 4.1, Eqs. (43) and (50): the cube on the plane, rotated by -0.2 rad about
/// z.
Pose pose_of_example_4_1(double scale);

/// One step of the paper, example 4.2.
struct PaperStep {
  double time_s = 0.0;
  Pose X_WP;
  bool in_contact = false;
  Wrench F_W;  ///< wrench on the cube about its centre of mass, in world axes
};

/// Simulates the paper, example 4.2: the cube starts in overlap at p of Eq. (52) with the body velocity of
/// Eq. (54). It moves freely under the wrench of Eq. (16) with k_P = 1, k_I = 0.5, k_D = 0.1 for 120 steps of
/// 0.05 s. Returns 121 entries; the first is the start. Not RT-safe: allocates.
std::vector<PaperStep> simulate_example_4_2(Method method);

/// Figures of the paper, example 4.2, as numbers.
struct PaperSummary {
  int steps_in_contact = 0;
  double max_force_y = 0.0;   ///< maximum of f_y (paper, Fig. 14)
  double max_torque_z = 0.0;  ///< maximum of |tau_z| (paper, Fig. 15)
};
PaperSummary summary_of(const std::vector<PaperStep>& steps);

}  // namespace wrenchd
