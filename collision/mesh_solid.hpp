// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "core/convex_body.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// The triangles of a mesh file that must be a closed, outward-oriented solid, in the file's own units.
/// Throws MeshError that names the file, the defect, its place and the cure. Not RT safe.
TriangleMesh load_solid(const std::filesystem::path& file);

/// Is a solid convex, but for what rounding of its corners takes away? Not RT safe.
bool fills_its_hull(const TriangleMesh& solid, const ConvexBody& hull);

}  // namespace wrenchd
