// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// The numbers of two triangles, the smaller one first.
using TrianglePairNumbers = std::array<std::uint32_t, 2>;

/// Returns the pairs of triangles that intersect beyond a common vertex or edge, at most `most`, each once
/// and in order./// Every edge of the mesh must have at most two triangles, wound alike. Large meshes are
/// divided by planes across their longest side, and each processor tests one part. Not RT-safe: allocates,
/// starts threads, takes a second or two per million triangles.
std::vector<TrianglePairNumbers> self_intersections(const TriangleMesh& mesh, std::size_t most);

/// Returns true if two triangles of a closed mesh intersect beyond a common vertex or edge. Not RT-safe: as
/// self_intersections().
bool intersects_itself(const TriangleMesh& mesh);

}  // namespace wrenchd
