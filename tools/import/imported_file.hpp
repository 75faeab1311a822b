// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// Geometric properties of the uniform solid of density 1, in the frame of the file.
struct GeometricProperties {
  double volume_mm3 = 0.0;
  double area_mm2 = 0.0;
  Vector3d centre_mm = Vector3d::Zero();    ///< centre of mass
  Matrix3d inertia_mm5 = Matrix3d::Zero();  ///< about the centre of mass, axes of the file
};

/// A part of an imported file. Coordinates are in millimetres in the frame of the file.
struct ImportedPart {
  std::string name;  ///< unique in the file
  /// One mesh for each solid of the part. The type calls its vertices metres; here they are millimetres. A
  /// part of a mesh file has one mesh, which may be open.
  std::vector<TriangleMesh> meshes;
  bool has_exact_surface = false;  ///< from a CAD file: `exact` and `chord_error_mm` are known
  GeometricProperties
      exact;  ///< volume, area and inertia of all solids of the part, from their exact surfaces
  double chord_error_mm = 0.0;  ///< measured; largest distance between the meshes and the exact surfaces
  std::string worst_place;      ///< place of the largest chord error
};

/// Content of an imported file.
struct ImportedFile {
  std::string format;                ///< "STEP", "glTF", ...
  std::string unit;                  ///< unit of the file, for reports: "inch"
  std::vector<ImportedPart> parts;   ///< the selected ones
  std::vector<std::string> remarks;  ///< what was changed or left out, one sentence each
};

/// A part that a file offers.
struct PartSummary {
  std::string name;
  std::string description;  ///< "2 solids, 120 x 40 x 8 mm"
};

/// Adds the properties of two uniform solids of density 1. Not RT-safe: no reason to be.
GeometricProperties sum(const GeometricProperties& a, const GeometricProperties& b);

/// Returns the properties of a closed, outward-oriented mesh in millimetres. Not RT-safe: linear in the
/// number of triangles.
GeometricProperties geometric_properties(const TriangleMesh& mesh_mm);

/// Returns the bytes of the content, for a pipe between two processes of this program. Not RT-safe:
/// allocates.
std::string packed(const ImportedFile& file);
std::string packed(const std::vector<PartSummary>& parts);
/// Reads such bytes. Returns false if they are incomplete. Not RT-safe: allocates.
bool unpack(const std::string& bytes, ImportedFile& file);
bool unpack(const std::string& bytes, std::vector<PartSummary>& parts);

}  // namespace wrenchd
