// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/generated_mesh.hpp"
#include "core/obstacle_motion.hpp"
#include "core/pose.hpp"
#include "core/triangle_mesh.hpp"

namespace wrenchd {

/// The tool: the virtual body that the user moves. M: frame of the mesh file.
struct ToolSettings {
  std::filesystem::path mesh;  ///< OFF, OBJ, STL or PLY file; a relative path is relative to the scene file
  double scale = 1.0;          ///< metres per mesh unit
  double mass_kg = 1.0;        ///< mass of the uniform solid; it scales T and moves no minimizer
  std::optional<GeneratedMesh> generated =
      {};  ///< mesh that wrenchd generates; then `mesh` is its generated_mesh_name() instead of a file
};

/// Solid half-space normal_W . x < offset_m.
struct HalfSpaceSettings {
  std::string name;
  Vector3d normal_W = Vector3d::UnitZ();  ///< unit normal, points out of the solid
  double offset_m = 0.0;
};

/// An obstacle with a mesh, at rest or moving. M: frame of the mesh file.
struct MeshObstacleSettings {
  std::string name;
  std::filesystem::path mesh;
  double scale = 1.0;  ///< metres per mesh unit
  Pose X_WM;           ///< pose at scene time 0
  /// A solid must be closed. A surface may be open or intersect itself; it has no inside, so it does not push
  /// out a tool that starts behind it or passes through it.
  BodyKind kind = BodyKind::solid;
  ObstacleMotion motion = {};  ///< motion of M; rotation is about the origin of M
  std::optional<ScheduledMotion> scheduled = {};
  /// mesh that wrenchd generates; then `mesh` is its generated_mesh_name() instead of a file
  std::optional<GeneratedMesh> generated = {};
};

struct SceneSettings {
  std::filesystem::path file;  ///< source file, for messages
  ToolSettings tool;
  std::vector<HalfSpaceSettings> half_spaces;
  std::vector<MeshObstacleSettings> meshes;
  /// Contacts may use a surface that encloses a solid and lies at most this far outside of it [m]; 0: the
  /// mesh as loaded. Rounding of single precision may raise it (collision/meshes/mesh_simplifier.hpp).
  double surface_tolerance_m = 1e-6;
};

}  // namespace wrenchd
