// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

#include "core/pose.hpp"

namespace wrenchd {

using Triangle = std::array<Vector3d, 3>;

/// Do two triangles have a point in common? Double precision: two that are apart or overlap by less than
/// rounding may be called either. RT safe.
bool triangles_intersect(const Triangle& p, const Triangle& q) noexcept;

}  // namespace wrenchd
