// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "collision/scene.hpp"
#include "core/projection.hpp"

namespace wrenchd {

/// By how much obstacles that move raise T of Eq. (8) around a hand that stands still, or lower it. For an
/// answer q at scene time to_s, and what its contacts' obstacles moved since from_s [s]:
///
///   dT = sum over the contacts of  multiplier n . (x - D^-1 x)       [kg m^2]
///
/// with x where they touch, n the normal towards the tool, and D the motion of the obstacle. It is of first
/// order: the mean of this at the beginning and at the end of a motion is what T really changed by, but for
/// third-order terms. RT safe.
double obstacle_work(const Projection& projection, const Scene& scene, double from_s, double to_s) noexcept;

}  // namespace wrenchd
