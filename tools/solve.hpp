// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <iosfwd>
#include <string>
#include <vector>

#include "collision/penetration.hpp"
#include "collision/scene.hpp"
#include "core/method.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// One row of the answer: the projection of one pose, and the wrench it gives.
struct SolvedPose {
  Penetration penetration;
  Pose X_WM;   ///< the mesh's own frame at q
  Wrench F_T;  ///< body wrench, Eq. (16) with K_P = k_P I alone
  Wrench F_S;  ///< spatial wrench, about the world origin
  double solve_ns = 0.0;
};

/// Projects every pose (of the mesh's own frame, in the world) on its own, without history.
std::vector<SolvedPose> solve(const Scene& scene, const std::vector<Pose>& X_WM, Method method, double k_P);

/// The rows as CSV, with a header, numbers in the shortest form that reads back the same.
void write_csv(std::ostream& out, const std::vector<SolvedPose>& rows);

}  // namespace wrenchd
