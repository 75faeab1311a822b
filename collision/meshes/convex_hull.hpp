// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>

#include "core/convex_body.hpp"

namespace wrenchd {

/// Returns the convex hull of points in T with the ordered neighbours of each vertex and its faces.
/// Precondition: the points span a volume. Not RT-safe: allocates, may take seconds.
ConvexBody convex_hull(std::span<const Vector3d> points_T_m);

/// Returns the volume of a convex body [cube of the vertices' unit]. RT-safe.
double volume(const ConvexBody& body);

}  // namespace wrenchd
