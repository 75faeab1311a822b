// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

#include "core/pose.hpp"

namespace wrenchd {

using Triangle = std::array<Vector3d, 3>;

/// Returns true if two triangles have a point in common. Uses double precision. The result is undefined if
/// the gap or the overlap is below rounding. RT-safe.
bool triangles_intersect(const Triangle& p, const Triangle& q) noexcept;

}  // namespace wrenchd
