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

/// The virtual body in the hand. M is the frame the mesh file is written in.
struct ToolSettings {
  std::filesystem::path mesh;  ///< OFF, OBJ, STL or PLY; relative paths are relative to the scene file
  double scale = 1.0;          ///< metres per mesh unit
  double mass_kg = 1.0;        ///< of the uniform solid; scales T, moves no minimiser
  std::optional<GeneratedMesh> generated =
      {};  ///< then it is made, and `mesh` is name_of() it instead of a file
};

/// Solid where normal_W . x < offset_m.
struct HalfSpaceSettings {
  std::string name;
  Vector3d normal_W = Vector3d::UnitZ();  ///< unit, points out of the solid
  double offset_m = 0.0;
};

/// A body of any shape, that stands still or moves. M is the frame its mesh file is written in.
struct MeshObstacleSettings {
  std::string name;
  std::filesystem::path mesh;
  double scale = 1.0;  ///< metres per mesh unit
  Pose X_WM;           ///< at scene time 0
  /// A surface may be open or cut through itself. It has no inside: nothing pushes a tool out that starts
  /// beyond it, or that it goes through.
  BodyKind kind = BodyKind::solid;
  ObstacleMotion motion = {};  ///< of M; turns are about M's origin
  std::optional<ScheduledMotion> scheduled = {};
  std::optional<GeneratedMesh> generated = {};  ///< as for the tool
};

struct SceneSettings {
  std::filesystem::path file;  ///< where it was read from, for messages
  ToolSettings tool;
  std::vector<HalfSpaceSettings> half_spaces;
  std::vector<MeshObstacleSettings> meshes;
};

}  // namespace wrenchd
