// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// A mesh that cannot be used: which file, what is wrong with it, where, and what to do. Several lines where
/// there is more than one defect.
class MeshError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A mesh as its file has it: polygons of any size, in file order, vertices in file units.
struct PolygonSoup {
  std::vector<Vector3d> vertices;
  std::vector<std::vector<std::size_t>> faces;
  /// Once something was taken out: the numbers in the file of what is left. Empty: nothing was.
  std::vector<std::size_t> vertex_numbers = {};
  std::vector<std::size_t> face_numbers = {};

  /// Number of a vertex or face in the file, from 0.
  std::size_t vertex_in_file(std::size_t v) const noexcept {
    return v < vertex_numbers.size() ? vertex_numbers[v] : v;
  }
  std::size_t face_in_file(std::size_t f) const noexcept {
    return f < face_numbers.size() ? face_numbers[f] : f;
  }
};

struct MeshSource;

/// The bytes of an OFF, OBJ, STL or PLY file. Throws MeshError. Not RT safe.
MeshSource read_mesh_source(const std::filesystem::path& file);

/// What the bytes say, of a format told by the file's extension. STL has no shared vertices: equal ones are
/// merged. Throws MeshError. Not RT safe.
PolygonSoup parse_mesh(MeshSource source);

/// Both. Throws MeshError. Not RT safe.
PolygonSoup read_mesh_file(const std::filesystem::path& file);

}  // namespace wrenchd
