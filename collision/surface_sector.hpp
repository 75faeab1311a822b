// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "collision/meshes/mesh_surface.hpp"
#include "core/pose.hpp"

// On which side of a surface a tool is, near the border of a feature. A sweep meets a feature also a little
// beyond its border, because paths are not quite straight. Beyond the border of a face, and beyond the end of
// an edge, the tool may be on the other side of the surface: it slides over the rim of a pocket and passes
// the far side of the pocket's wall, which must not hold it. A tool that a valley holds may also seem to pass
// a border, by the deviation of the path from a straight line. The start of the path tells the two apart,
// because the pose there is exact. core/METHOD.md, section 14.10.

namespace wrenchd {

/// Returns true if a face beside this one rises above `side`, its plane with the normal towards a tool, and a
/// point of the tool is behind that face: p, where it passes the plane, lies beyond the border between the
/// faces, and p_start, where it was at the start of the path, is behind the plane of the face beside.
/// RT-safe.
bool is_behind_rim(const MeshSurface& surface, std::uint32_t triangle, const MeshSurface::Plane& side,
                   const Vector3d& p, const Vector3d& p_start) noexcept;

/// Returns the point of an edge, or of its extension, at a fraction of the way to its second vertex [m].
/// RT-safe.
inline Vector3d point_on(const MeshSurface& surface, const MeshSurface::Edge& edge,
                         double fraction) noexcept {
  const Vector3d& from = surface.vertices_m()[edge.vertices[0]];
  return from + fraction * (surface.vertices_m()[edge.vertices[1]] - from);
}

/// Returns true if p, the point of an edge nearest to an edge of the other body, lies beyond an end of its
/// edge, and the other body is not in the sector from which the edge is convex: neither x, its point nearest
/// to p, nor x_start, where that point was at the start of the path. RT-safe.
bool is_behind_end(const MeshSurface& surface, const MeshSurface::Edge& edge, const Vector3d& p,
                   const Vector3d& x, const Vector3d& x_start) noexcept;

}  // namespace wrenchd
