// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <iosfwd>

#include "core/generated_mesh.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// A closed, outward-oriented solid in metres, its middle at the origin where nothing else is said. The same
/// arguments make the same mesh, but for how the machine's library rounds sines. Throws std::invalid_argument
/// where the kind is not known. Not RT safe.
TriangleMesh make_mesh(const GeneratedMesh& wanted);

/// As an OFF file, numbers in the shortest form that reads back the same.
void write_off(std::ostream& out, const TriangleMesh& mesh);

}  // namespace wrenchd
