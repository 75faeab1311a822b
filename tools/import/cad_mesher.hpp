// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>

#include <TopoDS_Solid.hxx>

#include "core/triangle_mesh.hpp"
#include "tools/import/cad_reader.hpp"
#include "tools/import/imported_file.hpp"

namespace wrenchd {

/// Bounds of a tessellation.
struct MeshingLimits {
  double chord_mm = 0.02;             ///< largest distance of the mesh from the exact surface
  std::size_t triangles = 2'000'000;  ///< largest number of triangles of all parts together
};

/// Returns the meshes and the exact properties of the solids of a model. Each mesh is closed: triangles of
/// neighbouring faces share their vertices. Its measured chord error is at most chord_mm (README.md). Throws
/// ImportError that names the part, the face and the remedy. For the child process only. Not RT-safe: may
/// take minutes.
ImportedFile mesh_model(CadModel model, const MeshingLimits& limits);

/// Returns the names of the parts with their solids and sizes. Not RT-safe: allocates.
std::vector<PartSummary> summarize(const CadModel& model);

/// Returns the properties of the exact surfaces of a solid. Not RT-safe.
GeometricProperties exact_properties(const TopoDS_Solid& solid);

}  // namespace wrenchd
