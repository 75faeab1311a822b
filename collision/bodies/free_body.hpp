// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <string>

#include "collision/meshes/mesh_bvh.hpp"
#include "collision/meshes/mesh_loader.hpp"
#include "collision/tool_body.hpp"
#include "core/free_motion.hpp"
#include "core/scene_settings.hpp"

namespace wrenchd {

/// A rigid body that moves by itself. B: body frame, parallel to the frame of the mesh file, with its origin
/// at the centre of mass.
struct FreeBody {
  std::string name;
  ToolBody body;      ///< its mesh and inertia
  BodyMotion motion;  ///< state at the start
  double friction = 0.5;
  double restitution = 0.0;
  double linear_damping_per_s = 0.0;
  double angular_damping_per_s = 0.0;
  bool of_hand = false;                      ///< the tool of a second hand, which moves as that hand leads it
  std::shared_ptr<const MeshBvh> mesh = {};  ///< of body.mesh, for contacts; null: built where it is needed
};

/// Loads and checks the mesh of a body of the scene. Throws MeshError that names the file, the defect, its
/// place and the remedy. Not RT-safe: reads a file, may take seconds.
FreeBody load_free_body(const BodySettings& settings, const SceneSettings& scene, MeshLoader& loader);

}  // namespace wrenchd
