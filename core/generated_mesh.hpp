// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/spatial.hpp"

namespace wrenchd {

/// A solid to try things with, so that no model has to be downloaded.
struct GeneratedMesh {
  static constexpr std::size_t kMinTriangles = 8,
                               kMaxTriangles = 20'000'000;  ///< triangles that may be asked for

  std::string kind;
  std::size_t triangles = 20000;               ///< about so many
  std::uint32_t seed = 1;                      ///< of `bumpy` and `boulder`: which one of the many
  Vector3d size_m = Vector3d::Constant(0.05);  ///< of `box`: its sides
};

struct MeshKind {
  std::string name;
  std::string description;  ///< one line, with its measures
};

/// The kinds of mesh that make_mesh() generates (collision/meshes/make_mesh.hpp).
const std::vector<MeshKind>& mesh_kinds();

/// "made gear, 5000 triangles": what stands in the place of a file's name. Different meshes have different
/// ones.
std::string generated_mesh_name(const GeneratedMesh& made);

}  // namespace wrenchd
