// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// A mesh with fewer triangles that encloses the solid it was made from.
struct SimplifiedMesh {
  TriangleMesh mesh;
  /// For each vertex the number of a vertex of the original mesh that was merged into it.
  std::vector<std::uint32_t> source_vertex;
  /// For each triangle the number of an original triangle of the same part of the surface.
  std::vector<std::uint32_t> source_triangle;
  /// Upper bound for the distance of any point of the simplified surface from the original surface [m].
  double distance_m = 0.0;
};

/// Returns `tolerance_m`, or the largest rounding error of single precision in `mesh` [m] if the latter is
/// larger. For a small mesh the result is at most 1e-4 of the mesh's size. Returns 0 if tolerance_m is 0. Not
/// RT-safe: takes milliseconds.
double simplification_tolerance_m(const TriangleMesh& mesh, double tolerance_m);

/// Returns a mesh that encloses `mesh` and lies within tolerance_m [m] of it, with as few triangles as edge
/// collapses reach: core/METHOD.md, section 14.8. A flat face becomes the few triangles that its border
/// needs; a curved face keeps what the tolerance requires. mesh: a closed, outward-oriented solid in metres.
/// Returns the mesh unchanged if it is not a manifold. The result does not intersect itself if `mesh` does
/// not. Deterministic. Not RT-safe: allocates, takes three to five seconds per million triangles on two
/// processors.
SimplifiedMesh simplify_enclosing(TriangleMesh mesh, double tolerance_m);

}  // namespace wrenchd
