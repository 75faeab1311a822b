// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "collision/scene.hpp"
#include "core/projection.hpp"

namespace wrenchd::test {

/// Returns the KKT residual of a projection, computed from p, q, the contacts and their multipliers alone:
/// the textbook form METHOD (23) of the gradients. Only contacts count whose gap is closed and whose point
/// lies on the tool and, for an obstacle with a mesh, on the obstacle.
double unbalanced_pull(const Scene& scene, const Pose& X_WP, const Projection& q);

}  // namespace wrenchd::test
