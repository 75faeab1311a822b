// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/spatial.hpp"

namespace wrenchd {

/// Describes a solid that make_mesh() generates (collision/meshes/make_mesh.hpp), so that a scene needs no
/// model file.
struct GeneratedMesh {
  static constexpr std::size_t kMinTriangles = 8;           ///< Fewest triangles that may be requested.
  static constexpr std::size_t kMaxTriangles = 20'000'000;  ///< Most triangles that may be requested.

  std::string kind;                            ///< One of mesh_kinds().
  std::size_t triangles = 20000;               ///< Approximate number of triangles.
  std::uint32_t seed = 1;                      ///< Selects the shape of `bumpy` and `boulder`.
  Vector3d size_m = Vector3d::Constant(0.05);  ///< Sides of `box`, along x, y and z.
};

struct MeshKind {
  std::string name;
  std::string description;  ///< One line, with its dimensions.
};

/// The kinds of mesh that make_mesh() generates (collision/meshes/make_mesh.hpp).
const std::vector<MeshKind>& mesh_kinds();

/// Returns a name such as "made gear, 5000 triangles", which stands in the place of a file name. Different
/// meshes have different names. Not RT-safe: allocates.
std::string generated_mesh_name(const GeneratedMesh& made);

}  // namespace wrenchd
