// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <vector>

#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// A mesh as its file states it: polygons of any size, in file order, with vertices in file units.
struct PolygonSoup {
  std::vector<Vector3d> vertices;
  std::vector<std::vector<std::size_t>> faces;
  /// Numbers in the file of the remaining vertices and faces. Empty as long as nothing was removed.
  std::vector<std::size_t> vertex_numbers = {};
  std::vector<std::size_t> face_numbers = {};

  /// Returns the number of a vertex or face in the file, from 0. RT-safe.
  std::size_t vertex_in_file(std::size_t v) const noexcept {
    return v < vertex_numbers.size() ? vertex_numbers[v] : v;
  }
  std::size_t face_in_file(std::size_t f) const noexcept {
    return f < face_numbers.size() ? face_numbers[f] : f;
  }
};

}  // namespace wrenchd
