// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// One body of several solids.
struct UnitedMesh {
  TriangleMesh mesh;
  /// False if the surfaces could not be united. `mesh` then holds the surfaces of all parts. They are closed
  /// and face outwards, so contacts with them are those of the union: a tool meets the outermost surface
  /// first. Only the volume in which parts overlap counts twice.
  bool united = true;
};

/// Returns the union of closed solids that face outwards and may overlap or touch each other. Uses CGAL's
/// corefinement in exact arithmetic, rounds the result, and checks it. Not RT-safe: allocates, may take
/// seconds.
UnitedMesh unite(const std::vector<TriangleMesh>& parts);

/// Returns the faces of all parts as one mesh. Not RT-safe: allocates.
TriangleMesh together(const std::vector<TriangleMesh>& parts);

}  // namespace wrenchd
