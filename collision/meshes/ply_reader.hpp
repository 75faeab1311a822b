// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "collision/meshes/mesh_source.hpp"
#include "collision/meshes/polygon_soup.hpp"

namespace wrenchd {

/// Reads the vertices, faces and triangle strips of an ASCII or binary PLY file and ignores all other
/// elements. Throws MeshError that names the line or the element, and the remedy. Not RT-safe: allocates in
/// proportion to the file.
PolygonSoup read_ply(const MeshSource& source);

}  // namespace wrenchd
