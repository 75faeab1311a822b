// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "collision/meshes/mesh_file.hpp"

namespace wrenchd {

/// A half-edge of a face: one side of the face with its direction.
struct HalfEdge {
  std::pair<std::size_t, std::size_t> edge;  ///< its vertices, the smaller number first
  std::size_t face;
  bool forward;  ///< true if the face traverses it from the smaller to the larger number
};

/// Returns the half-edges of all faces, sorted by edge (first vertex, second vertex) and then by face.
/// Precondition: all indices are in range. Not RT-safe: allocates.
std::vector<HalfEdge> half_edges_of(const PolygonSoup& soup);

/// Calls use(span of half-edges) for each edge.
template <class Use>
void for_each_edge(std::span<const HalfEdge> half_edges, const Use& use) {
  for (std::size_t i = 0, end = 0; i < half_edges.size(); i = end) {
    while (end < half_edges.size() && half_edges[end].edge == half_edges[i].edge) ++end;
    use(half_edges.subspan(i, end - i));
  }
}

}  // namespace wrenchd
