// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>

#include "core/convex_body.hpp"

namespace wrenchd {

/// Convex hull of points in T, with each vertex's neighbours in order, and its faces. The points must span a
/// volume. Not RT safe.
ConvexBody convex_hull(std::span<const Vector3d> points_T_m);

/// Volume of a convex body [the unit of its vertices, cubed].
double volume(const ConvexBody& body);

}  // namespace wrenchd
