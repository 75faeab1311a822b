// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "core/triangle_mesh.hpp"
#include "tools/import/imported_file.hpp"

namespace wrenchd {

/// One body of all parts of an imported file, checked as wrenchd checks a mesh file.
struct ImportedBody {
  TriangleMesh mesh_mm;  ///< closed and outward-oriented, unless surface is true
  bool surface = false;  ///< no closed solid
  bool has_exact_surface = false;
  GeometricProperties exact;    ///< sum of the solids; where they overlap, the volume counts twice
  double overlap_mm3 = 0.0;     ///< volume that counts twice
  double chord_error_mm = 0.0;  ///< chord error of mesh_mm, before a file format rounds its coordinates
  std::string worst_place;
  std::vector<std::string> remarks;
};

/// What join_parts() accepts.
struct Joining {
  bool surface = false;  ///< a mesh that is no solid becomes a surface
  bool unite = false;    ///< solids of a CAD file that overlap become their union
  /// Largest chord error of a body of a CAD file. Solids that touch are grown by at most what their chord
  /// error leaves of it, if their surfaces cannot be united otherwise. 0: solids are not grown.
  double chord_mm = 0.0;
};

/// Joins all solids to one body: their union, if they touch. Solids of a CAD file overlap if the overlap is
/// thicker than their chord errors explain. Throws ImportError with the place and the remedy if such solids
/// overlap, if the result is no solid, or if its volume differs from the exact one by more than the chord
/// error explains. Not RT-safe: may take minutes.
ImportedBody join_parts(ImportedFile file, const Joining& joining = {});

}  // namespace wrenchd
