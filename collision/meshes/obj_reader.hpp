// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "collision/meshes/mesh_source.hpp"
#include "collision/meshes/polygon_soup.hpp"

namespace wrenchd {

/// Reads the vertices and faces of an OBJ file and ignores all other statements. Throws MeshError that names
/// the line and the remedy. Not RT-safe: allocates in proportion to the file.
PolygonSoup read_obj(MeshSource source);

}  // namespace wrenchd
