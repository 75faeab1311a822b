// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "collision/meshes/mesh_source.hpp"
#include "collision/meshes/polygon_soup.hpp"
#include "core/files/opened_file.hpp"

namespace wrenchd {

/// Returns the bytes of an OFF, OBJ, STL or PLY file, which is opened once. scope: where the file may be.
/// Throws MeshError. Not RT-safe: reads a file.
MeshSource read_mesh_source(const std::filesystem::path& file, const FileScope& scope = {});

/// Returns the polygons of a mesh file. The extension of the file name selects the format. Merges equal
/// vertices of STL, which has no shared vertices. Throws MeshError. Not RT-safe: allocates, may take seconds.
PolygonSoup parse_mesh(MeshSource source);

}  // namespace wrenchd
