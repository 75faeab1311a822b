// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>

#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// Throws ImportError if no mesh can be written to a file with this extension. Not RT-safe: allocates.
void require_mesh_extension(const std::filesystem::path& file);

/// Returns true if files with this extension hold coordinates in single precision: binary STL. Not RT-safe:
/// allocates.
bool has_single_precision(const std::filesystem::path& file);

/// Returns the largest distance by which a file with this extension moves a vertex of the mesh [mm]; 0
/// without single precision. Not RT-safe: linear in the number of vertices.
double rounding_mm(const TriangleMesh& mesh_mm, const std::filesystem::path& file);

/// Returns the content of a binary STL, OFF, PLY or OBJ file, by the extension. statement: one line that the
/// file contains as a comment; an STL header has room for 79 bytes of it. Not RT-safe: allocates.
std::string mesh_file_text(const TriangleMesh& mesh_mm, const std::filesystem::path& file,
                           const std::string& statement);

}  // namespace wrenchd
