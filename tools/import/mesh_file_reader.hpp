// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "tools/import/imported_file.hpp"

namespace wrenchd {

/// A mesh format that assimp reads.
enum class MeshFormat { gltf, glb, threemf, collada, obj, ply, stl };

/// How to read a mesh file.
struct MeshReading {
  MeshFormat format = MeshFormat::gltf;
  double unit_mm = 0.0;          ///< unit of a file that states none; 0: such a file is rejected
  bool unit_is_default = false;  ///< also accept files that state their unit
  std::size_t max_triangles = 2'000'000;
  /// Content of the files that the file refers to, by the name it uses: the buffers of a glTF file.
  std::map<std::string, std::string> companions = {};
};

/// Returns the triangles of a mesh file in millimetres: one part for each node or group. Positions of
/// neighbouring triangles that are equal in the file are equal in the result. Throws ImportError. For the
/// child process only. Not RT-safe: allocates, may take minutes.
ImportedFile read_mesh_file(const std::string& bytes, const MeshReading& reading);

/// Returns the names of the buffers that a glTF file takes from other files. Throws ImportError if the file
/// is no JSON. Not RT-safe: allocates.
std::vector<std::string> gltf_companions(const std::string& bytes);

}  // namespace wrenchd
