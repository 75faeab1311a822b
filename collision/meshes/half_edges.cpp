// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/half_edges.hpp"

#include <algorithm>
#include <numeric>
#include <tuple>

namespace wrenchd {

// Buckets by vertex first, so that each sort is short.
std::vector<HalfEdge> half_edges_of(const PolygonSoup& soup) {
  const auto each = [&](const auto& use) {
    for (std::size_t f = 0; f < soup.faces.size(); ++f) {
      const auto& face = soup.faces[f];
      for (std::size_t i = 0; i < face.size(); ++i) {
        const auto [low, high] = std::minmax(face[i], face[i + 1 < face.size() ? i + 1 : 0]);
        use(HalfEdge{{low, high}, f, low == face[i]});
      }
    }
  };
  std::vector<std::size_t> begin(soup.vertices.size() + 1, 0);
  each([&](const HalfEdge& half_edge) { ++begin[half_edge.edge.first + 1]; });
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<HalfEdge> half_edges(begin.back());
  std::vector<std::size_t> at(begin.begin(), begin.end() - 1);
  each([&](const HalfEdge& half_edge) { half_edges[at[half_edge.edge.first]++] = half_edge; });
  for (std::size_t v = 0; v < soup.vertices.size(); ++v)
    std::sort(half_edges.begin() + static_cast<std::ptrdiff_t>(begin[v]),
              half_edges.begin() + static_cast<std::ptrdiff_t>(begin[v + 1]),
              [](const HalfEdge& a, const HalfEdge& b) {
                return std::tuple(a.edge.second, a.face, a.forward) <
                       std::tuple(b.edge.second, b.face, b.forward);
              });
  return half_edges;
}

}  // namespace wrenchd
