// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "collision/meshes/mesh_source.hpp"
#include "collision/meshes/polygon_soup.hpp"

namespace wrenchd {

/// Reads an ASCII OFF file (keyword OFF, COFF, NOFF or CNOFF). A face may occupy several
/// lines. Ignores normals and colours. Throws MeshError
/// that names the line and the remedy. Not RT-safe: allocates in proportion to the file.
PolygonSoup read_off(const MeshSource& source);

}  // namespace wrenchd
