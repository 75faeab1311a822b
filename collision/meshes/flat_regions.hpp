// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "collision/meshes/half_edge_mesh.hpp"

namespace wrenchd {

/// The flat parts of a surface. Each face belongs to one region of connected faces, whose corners lie within
/// a tolerance of one plane. A face that no neighbour continues is a region of its own.
struct FlatRegions {
  /// The plane normal . x = offset_m with an outward unit normal. It encloses the region: no corner of the
  /// region lies above it.
  struct Plane {
    Vector3d normal;
    double offset_m;
  };
  std::vector<std::uint32_t> region_of_face;
  std::vector<Plane> planes;     ///< one for each region
  std::vector<double> areas_m2;  ///< area of each region [m^2]
};

/// Finds the flat regions of a manifold mesh, the largest faces first. tolerance_m: largest distance of a
/// corner from the plane that fits its region best [m]. Not RT-safe: allocates.
FlatRegions find_flat_regions(const HalfEdgeMesh& mesh, double tolerance_m);

}  // namespace wrenchd
