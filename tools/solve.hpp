// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <iosfwd>
#include <string>
#include <vector>

#include "collision/penetration.hpp"
#include "collision/scene.hpp"
#include "core/spatial.hpp"
#include "core/wrench_law.hpp"

namespace wrenchd {

/// One row of the answer: the projection of one pose, and the wrench it gives.
struct SolvedPose {
  Penetration penetration;
  Pose X_WM;   ///< the mesh's own frame at q
  Wrench F_T;  ///< body wrench, of the law asked for
  Wrench F_S;  ///< spatial wrench, about the world origin
  double solve_ns = 0.0;
};

/// How the poses are projected, and what makes a wrench of it.
struct SolveSettings {
  PenetrationDepth::Options depth;
  SpringLaw law = SpringLaw::pid;
  double k_P = 1.0;  ///< pid: K_P = k_P I, no integral, no derivative
  double energy_stiffness_per_s2 = 1.0;
  bool proxy = false;  ///< follow the poses as a trajectory, each from the answer before, as the daemon does
  /// Of the trajectory: row i is at scene time i / rate_Hz. Without proxy all is as at scene time 0.
  double rate_Hz = 1000.0;
};

/// Projects every pose (of the mesh's own frame, in the world): on its own, without history, unless a proxy
/// is asked for.
std::vector<SolvedPose> solve(const Scene& scene, const std::vector<Pose>& X_WM,
                              const SolveSettings& settings);

/// The rows as CSV, with a header, numbers in the shortest form that reads back the same. proxy: with the
/// status and the iterations of each.
void write_csv(std::ostream& out, const std::vector<SolvedPose>& rows, bool proxy = false);

}  // namespace wrenchd
