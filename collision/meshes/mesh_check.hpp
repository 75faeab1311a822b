// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "collision/meshes/mesh_file.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// What a mesh is, and what keeps it from being a solid.
struct MeshReport {
  std::size_t vertices = 0;
  std::size_t faces = 0;
  bool closed = false;      ///< every edge belongs to exactly two faces
  bool consistent = false;  ///< neighbouring faces run along their common edge in opposite directions
  bool outward = false;     ///< the faces bound a volume, with their outer side outside
  bool self_intersecting = false;
  double volume = 0.0;  ///< in file units cubed; NaN while the mesh is not closed and consistent
  std::vector<std::string> repairs = {};  ///< what was repaired before, a sentence each (mesh_repair.hpp)
  std::vector<std::string> defects;       ///< one sentence each: what, where, how many, and the cure

  bool solid() const noexcept { return defects.empty(); }
};

/// What makes a soup nothing at all: coordinates that are no numbers, indices of vertices that are not there.
/// One sentence each; none where all is right. Not RT safe.
std::vector<std::string> find_invalid_values(const PolygonSoup& soup);

/// Looks at everything that makes a mesh a closed, consistently oriented solid. Names faces and vertices by
/// their number in the file, from 0. `triangles` receives the triangulated surface when there is no defect.
/// Not RT safe.
MeshReport check_solid(const PolygonSoup& soup, TriangleMesh* triangles = nullptr);

/// Looks at what even a surface must be: numbers, indices, and faces that have an area. It may be open, cut
/// through itself and have edges of any number of faces; closed, consistent and outward are not looked at.
/// Not RT safe.
MeshReport check_surface(const PolygonSoup& soup, TriangleMesh* triangles = nullptr);

/// The same of what is left to repair() first; the report tells both. Not RT safe.
MeshReport repair_and_check_solid(PolygonSoup& soup, TriangleMesh* triangles = nullptr);
MeshReport repair_and_check_surface(PolygonSoup& soup, TriangleMesh* triangles = nullptr);

}  // namespace wrenchd
