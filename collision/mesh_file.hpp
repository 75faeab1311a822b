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
};

/// Reads OFF, OBJ, STL or PLY, told apart by the extension. STL has no shared vertices: equal ones are
/// merged. Throws MeshError. Not RT safe.
PolygonSoup read_mesh_file(const std::filesystem::path& file);

}  // namespace wrenchd
