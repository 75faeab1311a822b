// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace wrenchd {

/// A mesh as a screen wants it, in its own frame [m]: corners with a position and a normal, three of them a
/// triangle, and the edges at which the surface bends, two points each.
struct DisplayMesh {
  std::vector<float> positions;        ///< 3 a corner
  std::vector<float> normals;          ///< likewise; smooth but for bends of more than kCrease_rad
  std::vector<std::uint32_t> indices;  ///< 3 a triangle
  std::vector<float> lines;            ///< 6 a line
  std::size_t source_triangles = 0;    ///< before it was made coarser
  std::size_t triangles() const noexcept { return indices.size() / 3; }
};

inline constexpr double kCrease_rad = 0.6;  ///< 34 degrees

/// vertices: three numbers each. triangles: numbers of vertices, counter-clockwise seen from outside. Above
/// `most` triangles the vertices within a cell of a grid become one, which lies where the planes of their
/// triangles meet best, so that edges stay sharp. For looking at, and for nothing else. Throws
/// std::invalid_argument where a triangle names a vertex that is not there.
DisplayMesh display_mesh(std::span<const float> vertices,
                         std::span<const std::array<std::uint32_t, 3>> triangles, std::size_t most);

}  // namespace wrenchd
