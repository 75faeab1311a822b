// SPDX-License-Identifier: GPL-3.0-or-later
#include <map>

#include <catch2/catch.hpp>

#include "collision/meshes/half_edges.hpp"
#include "tests/support/sample_meshes.hpp"

namespace wrenchd::test_half_edges {

namespace {

using namespace test;

TEST_CASE("every half-edge is listed, grouped by edge", "[half_edges]") {
  PolygonSoup soup = box({0, 0, 0}, {1, 1, 1});
  soup.faces.push_back({0, 1, 5});
  soup.faces.push_back({7, 7});
  const std::vector<HalfEdge> sides = half_edges_of(soup);
  CHECK(sides.size() == 6 * 4 + 3 + 2);
  std::map<std::pair<std::size_t, std::size_t>, int> edges;
  for_each_edge(sides, [&](std::span<const HalfEdge> along) {
    CHECK(++edges[along[0].edge] == 1);
    for (std::size_t i = 0; i < along.size(); ++i) {
      CHECK(along[i].edge == along[0].edge);
      CHECK((i == 0 || along[i - 1].face <= along[i].face));
      const auto& face = soup.faces[along[i].face];
      const auto [low, high] = along[i].edge;
      CHECK(low <= high);
      const auto from = along[i].forward ? low : high, to = along[i].forward ? high : low;
      bool runs = false;
      for (std::size_t k = 0; k < face.size(); ++k)
        runs = runs || (face[k] == from && face[(k + 1) % face.size()] == to);
      CHECK(runs);
    }
  });
  CHECK(edges.size() == 12 + 1 + 1);  // a diagonal, and a side from a corner to itself
  CHECK(half_edges_of({}).empty());
}

}  // namespace
}  // namespace wrenchd::test_half_edges
