// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "collision/meshes/mesh_file.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// Properties of a mesh, and the defects that prevent its use.
struct MeshReport {
  std::size_t vertices = 0;
  std::size_t faces = 0;
  bool closed = false;             ///< every edge belongs to exactly two faces
  bool consistent = false;         ///< adjacent faces traverse their common edge in opposite directions
  bool outward = false;            ///< the faces bound a volume and face outwards
  bool self_intersecting = false;  ///< faces intersect deeper than is tolerated
  double volume = 0.0;             ///< cube of the file's unit; NaN unless the mesh is closed and consistent
  /// Why a solid is accepted although its faces intersect: overlaps of at most 1e-5 of its diagonal. Empty:
  /// no faces intersect.
  std::string tolerated = {};
  std::vector<std::string> repairs = {};  ///< one sentence for each kind of repair (mesh_repair.hpp)
  std::vector<std::string> defects;       ///< one sentence each: what, where, how many, and the remedy

  bool solid() const noexcept { return defects.empty(); }
};

/// Returns one sentence for each kind of invalid value: coordinates that are not finite, vertex indices out
/// of range. Not RT-safe: allocates.
std::vector<std::string> find_invalid_values(const PolygonSoup& soup);

/// Checks that a mesh is a closed, consistently oriented solid. Its faces may overlap each other by at most
/// 1e-5 of its diagonal, if they bound one solid beyond that distance. Reports name faces and vertices by
/// their numbers in the file, from 0. `triangles` receives the triangulated surface if there is no defect.
/// Not RT-safe: allocates, may take seconds.
MeshReport check_solid(const PolygonSoup& soup, TriangleMesh* triangles = nullptr);

/// Checks that a mesh can be used as a surface: finite coordinates, valid indices, faces with an area. The
/// surface may be open, may intersect itself, and may have any number of faces at an edge. The members
/// closed, consistent and outward are not computed. Not RT-safe: allocates, may take seconds.
MeshReport check_surface(const PolygonSoup& soup, TriangleMesh* triangles = nullptr);

/// Calls repair() and then checks the result. The report contains repairs and defects. Not RT-safe:
/// allocates, may take seconds.
MeshReport repair_and_check_solid(PolygonSoup& soup, TriangleMesh* triangles = nullptr);
MeshReport repair_and_check_surface(PolygonSoup& soup, TriangleMesh* triangles = nullptr);

/// Returns the connected shells of a soup, each as a solid of its own. Returns nothing if one of them is
/// none: for example a cavity. Not RT-safe: allocates, may take seconds.
std::vector<TriangleMesh> solid_shells(const PolygonSoup& soup);

}  // namespace wrenchd
