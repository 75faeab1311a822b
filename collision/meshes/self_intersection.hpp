// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Surface_mesh.h>

#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// A mesh of triangles for CGAL, with exact predicates.
using ExactMesh = CGAL::Surface_mesh<CGAL::Exact_predicates_inexact_constructions_kernel::Point_3>;
using FacePair = std::pair<ExactMesh::Face_index, ExactMesh::Face_index>;

/// Returns the pairs of triangles that intersect beyond a common vertex or edge, at most about `most`, each
/// once and in order. Large meshes are divided by planes across their longest side, and each processor tests
/// one part. Not RT-safe: allocates, starts threads, takes a second or two per million triangles.
std::vector<FacePair> self_intersections(const ExactMesh& mesh, std::size_t most);

/// Returns true if two triangles of a closed mesh intersect beyond a common vertex or edge. Not RT-safe: as
/// self_intersections().
bool intersects_itself(const TriangleMesh& mesh);

}  // namespace wrenchd
