// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "collision/meshes/mesh_file.hpp"

namespace wrenchd {

/// A side of a face, as the face runs along it.
struct HalfEdge {
  std::pair<std::size_t, std::size_t> edge;  ///< its vertices, the smaller first
  std::size_t face;
  bool forward;  ///< from the smaller vertex to the larger
};

/// The sides of all faces, those of one edge next to each other, in the order of the faces. Edges come in the
/// order of their vertices. Every index must be in range.
std::vector<HalfEdge> half_edges_of(const PolygonSoup& soup);

/// Calls look(sides) with the sides of each edge.
template <class Look>
void for_each_edge(std::span<const HalfEdge> sides, const Look& look) {
  for (std::size_t i = 0, end = 0; i < sides.size(); i = end) {
    while (end < sides.size() && sides[end].edge == sides[i].edge) ++end;
    look(sides.subspan(i, end - i));
  }
}

}  // namespace wrenchd
