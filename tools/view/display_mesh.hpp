// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace wrenchd {

/// A mesh for display, in its own frame [m]: vertices with position and normal, triangles as indices, and
/// lines along creases.
struct DisplayMesh {
  std::vector<float> positions;        ///< 3 per vertex
  std::vector<float> normals;          ///< 3 per vertex; smooth except at creases sharper than kCrease_rad
  std::vector<std::uint32_t> indices;  ///< 3 per triangle
  std::vector<float> lines;            ///< 6 per line
  std::size_t source_triangles = 0;    ///< number of triangles before simplification
  std::size_t triangles() const noexcept { return indices.size() / 3; }
};

inline constexpr double kCrease_rad = 0.6;  ///< 34 degrees

/// Builds the mesh for display only. vertices: three numbers each. triangles: vertex indices,
/// counter-clockwise seen from outside. If there are more than `most` triangles, merges the vertices within
/// each cell of a grid. The merged vertex minimizes the distance to the planes of its triangles, so edges
/// remain sharp. Throws std::invalid_argument if an index is out of range. Not RT-safe: takes seconds for
/// millions of triangles.
DisplayMesh display_mesh(std::span<const float> vertices,
                         std::span<const std::array<std::uint32_t, 3>> triangles, std::size_t most);

}  // namespace wrenchd
