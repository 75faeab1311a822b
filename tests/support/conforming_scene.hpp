// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "collision/scene.hpp"
#include "tests/support/conforming_case.hpp"

namespace wrenchd::test {

/// A conforming case, loaded from mesh files as wrenchd loads a scene. C: frame of the tool's shape. F: frame
/// of both mesh files. W is the frame of the obstacle's shape.
struct ConformingScene {
  Scene scene;
  Pose X_TC;                        ///< pose of C in the tool's body frame
  Pose X_WF;                        ///< pose of the obstacle's file frame
  TriangleMesh tool_F, obstacle_F;  ///< triangles of the files, in metres
  double load_s = 0.0;              ///< time that the scene took to load

  /// Pose of the tool's body frame in the frame of its file.
  Pose X_FT() const { return scene.tool().X_MT(); }
};

/// Returns a mesh as the case's files contain it: rotated and rounded, in metres. Not RT-safe: allocates.
TriangleMesh mesh_in_file(const ConformingCase& of, const TriangleMesh& mesh);

/// Writes the meshes to a temporary directory, as binary STL in millimetres if the case is in float, else as
/// OFF, and loads the scene. surface_tolerance_m: that of the scene. motion: that of the obstacle. Throws
/// MeshError if a mesh cannot be used. Not RT-safe: may take seconds.
ConformingScene load_scene(const ConformingCase& of, const MeshesOfCase& meshes, MeshLoader& loader,
                           double surface_tolerance_m = SceneSettings{}.surface_tolerance_m,
                           const ObstacleMotion& motion = {});

/// Loads the coarse meshes of a case: exact, not rotated and not simplified. Not RT-safe: may take seconds.
ConformingScene load_coarse_scene(const ConformingCase& of);

/// Returns the poses X_WP of the tool's body frame for the poses X_WC of its shape.
std::vector<Pose> body_poses(const ConformingScene& scene, const std::vector<Pose>& X_WC);

}  // namespace wrenchd::test
