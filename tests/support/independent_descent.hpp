// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/inertia.hpp"
#include "core/pose.hpp"
#include "tests/support/exact_intersection.hpp"

namespace wrenchd::test {

/// Looks for an admissible pose near X_WQ that is closer to X_WP: a random search, (1+1) evolution strategy
/// with the one-fifth rule of success, which knows nothing of contacts, gradients and kernels. It asks
/// `exact` whether the tool, whose triangles are in frame E, meets the obstacle, which is at X_WO. No step is
/// longer than a tenth of a millimetre, so the search stays on the side where X_WQ is. Returns the least
/// energy T that was found, METHOD (7); that of X_WQ if no pose was better.
double descend_at_random(const ExactIntersection& exact, const Inertia& M, const Pose& X_WP, const Pose& X_WQ,
                         const Pose& X_WO, const Pose& X_TE, std::uint64_t seed, int steps);

}  // namespace wrenchd::test
