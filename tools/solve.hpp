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

/// The projection of one pose and the resulting wrench.
struct SolvedPose {
  Penetration penetration;
  Pose X_WM;   ///< pose of the mesh frame at q
  Wrench F_T;  ///< body wrench of the selected law
  Wrench F_S;  ///< spatial wrench, about the world origin
  double solve_ns = 0.0;
};

/// Settings of the projection and the wrench law.
struct SolveSettings {
  PenetrationDepth::Options depth;
  SpringLaw law = SpringLaw::pid;
  double k_P = 1.0;  ///< only for law pid: K_P = k_P I, without integral and derivative
  double energy_stiffness_per_s2 = 1.0;
  /// Follow the poses as a trajectory with the previous answer as history, as the daemon does.
  bool proxy = false;
  /// Rate of the trajectory: row i has scene time i / rate_Hz. Without proxy, all rows have scene time 0.
  double rate_Hz = 1000.0;
};

/// Projects each pose of the mesh frame in the world: independently, or as a trajectory if settings.proxy is
/// true. Not RT-safe: allocates.
std::vector<SolvedPose> solve(const Scene& scene, const std::vector<Pose>& X_WM,
                              const SolveSettings& settings);

/// Writes the rows as CSV with a header. Numbers have the shortest form that converts back to the same value.
/// proxy: adds columns for status and iterations before the last one, the KKT residual. Not RT-safe: writes
/// to a stream.
void write_csv(std::ostream& out, const std::vector<SolvedPose>& rows, bool proxy = false);

}  // namespace wrenchd
