// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>

#include "core/convex_body.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// Returns the convex hull of points in T with the ordered neighbours of each vertex and its faces.
/// Points that lie in one plane, as those of a flat sheet, receive a thickness of 2e-6 of their size, so that
/// the hull has a volume. Precondition: the points do not lie on one line. Not RT-safe: allocates, may take
/// seconds.
ConvexBody convex_hull(std::span<const Vector3d> points_T_m);

/// Returns the convex hull of the vertices of a mesh. First discards each vertex that lies in the convex hull
/// of its neighbours, up to rounding. This is faster than convex_hull() of the points if the mesh has many
/// triangles in flat or singly curved walls. Not RT-safe: allocates, may take seconds.
ConvexBody convex_hull(const TriangleMesh& mesh);

/// Returns the volume of a convex body [cube of the vertices' unit]. RT-safe.
double volume(const ConvexBody& body);

/// Returns the surface of a convex body: its triangles, outward. Not RT-safe: allocates.
TriangleMesh hull_surface(const ConvexBody& body);

}  // namespace wrenchd
