// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "collision/scene.hpp"
#include "core/projection.hpp"

namespace wrenchd {

/// Returns the change of T of Eq. (8) that moving obstacles cause while the hand stands still: METHOD (69).
/// For an answer q at scene time to_s [s] and obstacle motions D since from_s [s]:
///
///   dT = sum over the contacts of  multiplier n . (x - D^-1 x)       [kg m^2]
///
/// x is the contact point and n the normal towards the tool. The expression is of first order. The mean of
/// its values at the beginning and at the end of a motion equals the change of T up to third-order terms.
/// RT-safe.
double obstacle_work(const Projection& projection, const Scene& scene, double from_s, double to_s) noexcept;

}  // namespace wrenchd
