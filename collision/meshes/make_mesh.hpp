// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <iosfwd>

#include "core/generated_mesh.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// Generates a closed, outward-oriented solid in metres with its centre at the origin unless its kind states
/// otherwise. Equal arguments yield equal meshes, except for the rounding of the machine's sine function.
/// Throws std::invalid_argument if the kind is unknown. Not RT-safe: allocates, may take seconds.
TriangleMesh make_mesh(const GeneratedMesh& request);

/// Writes the mesh as an OFF file. Each number has the shortest text that reads back to the same value. Not
/// RT-safe: writes to a stream.
void write_off(std::ostream& out, const TriangleMesh& mesh);

}  // namespace wrenchd
