// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "collision/meshes/mesh_surface.hpp"
#include "collision/pairs/triangle_intersection.hpp"
#include "core/pose.hpp"

// The decisions of a sweep as signs that are exact for the given numbers: CGAL evaluates them in interval
// arithmetic, and in rational arithmetic if an interval contains zero. Positions at a path fraction are
// constructions, in double precision. Not RT-safe: rational arithmetic allocates.

namespace wrenchd::exact {

/// Returns the sign of the height of p above a plane, minus height_m: n . p - offset - height.
int side_of_plane(const MeshSurface::Plane& plane, double height_m, const Vector3d& p_m);

/// Returns true if two triangles have a common point.
bool triangles_intersect(const Triangle& p, const Triangle& q);

/// Returns true if the projection of p along `normal` lies inside a triangle, or at most tolerance_m outside.
/// normal: unit normal of the triangle, which is counterclockwise about it.
bool projects_inside(const Vector3d& p_m, const Triangle& triangle, const Vector3d& normal,
                     double tolerance_m);

/// Returns true if d falls along n by at most drop_m: n . d >= -drop.
bool rises(const Vector3d& n, const Vector3d& d, double drop_m = 0.0);

/// Two lines, one through a0 along da and one through b0 along db. sign (da x db) points away from the
/// obstacle b.
struct EdgePair {
  Vector3d a0, da, b0, db;
  double sign;
};

/// Returns the sign of the gap of two lines, minus height_m: sign (da x db) . (a0 - b0) / |da x db| - height.
int compare_gap(const EdgePair& pair, double height_m);

/// Returns true if the common perpendicular of the lines meets both edges, a0 to a0 + da and b0 to b0 + db,
/// or the lines at most tolerance_m beyond them.
bool edges_opposite(const EdgePair& pair, double tolerance_m);

}  // namespace wrenchd::exact
