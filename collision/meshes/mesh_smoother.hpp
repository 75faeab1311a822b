// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "collision/meshes/mesh_simplifier.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// How a mesh is smoothed.
struct Smoothing {
  double most_m = 0.0;  ///< largest distance between the smooth surface and the mesh [m]; 0: not smoothed
  /// Largest number of triangles of the result, unless the mesh itself has more.
  std::size_t max_triangles = kMaxTrianglesForMeshes;

  /// For contacts with meshes: a proxy keeps up with it.
  static constexpr std::size_t kMaxTrianglesForMeshes = 150'000;
  /// For contacts with half-spaces only, which need the vertices of the convex hull.
  static constexpr std::size_t kMaxTrianglesForHalfSpaces = 1'000'000;
};

/// Returns a mesh with more triangles that follow a curved surface through the vertices of `mesh`: on each
/// triangle a cubic patch with the vertex normals of the mesh (core/METHOD.md, section 14.11). Edges whose
/// faces meet at a larger angle than kCreaseAngle_rad stay edges, and flat faces stay as they are. No point
/// moves by more than smoothing.most_m away from its triangle; what would bulge further is flattened. mesh:
/// in metres, counter-clockwise seen from outside; it may have borders. Deterministic. Not RT-safe:
/// allocates, takes about 1 s.
SimplifiedMesh smoothed(const TriangleMesh& mesh, const Smoothing& smoothing);

/// Largest angle between the normals of two faces whose common edge is taken for an approximation of a curved
/// surface [rad].
inline constexpr double kCreaseAngle_rad = 0.7;

}  // namespace wrenchd
