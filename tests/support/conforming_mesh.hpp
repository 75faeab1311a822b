// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <iosfwd>
#include <numbers>
#include <vector>

#include "core/triangle_mesh.hpp"

namespace wrenchd::test {

inline constexpr double kFullTurn_rad = 2.0 * std::numbers::pi;

/// A polygon around the z axis at one height. Corner i is at angle 2 pi i / corners.
struct ProfileRing {
  double z_m;
  std::function<double(double angle)> radius_m;
};

/// A polyhedron with flat facets around the z axis, whose shape does not depend on its tessellation.
struct Prism {
  std::vector<ProfileRing> outside;  ///< from low to high
  std::vector<ProfileRing> bore;     ///< from low to high; empty: no bore
  std::uint32_t corners = 8;         ///< number of corners of each polygon
};

/// Number of parts into which the facets of a prism are divided. The divided facets stay flat.
struct FacetParts {
  std::uint32_t across = 1;      ///< parts of each polygon edge
  std::uint32_t along = 1;       ///< parts of the longest outer facet along z
  std::uint32_t along_bore = 1;  ///< parts of the longest facet of the bore along z
};

/// Returns the closed, outward-oriented mesh of a prism, in metres. Not RT-safe: allocates.
TriangleMesh make_prism(const Prism& prism, const FacetParts& parts);

/// Returns the mesh with each vertex rotated. Not RT-safe: allocates.
TriangleMesh rotated(TriangleMesh mesh, const Quaterniond& R);

/// Writes the mesh as binary STL, in millimetres, each coordinate rounded to float. Not RT-safe: writes to a
/// stream.
void write_binary_stl(std::ostream& out, const TriangleMesh& mesh);

}  // namespace wrenchd::test
