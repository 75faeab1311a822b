// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "collision/meshes/mesh_source.hpp"
#include "collision/meshes/polygon_soup.hpp"

namespace wrenchd {

/// Reads an ASCII or binary STL file and merges equal vertices, because the format has no shared ones. Throws
/// MeshError that names the line or the face, and the remedy. Not RT-safe: allocates in proportion to the
/// file.
PolygonSoup read_stl(const MeshSource& source);

}  // namespace wrenchd
