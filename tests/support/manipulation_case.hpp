// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "collision/meshes/make_mesh.hpp"
#include "collision/scene.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test {

/// How a hand moves a tool, at 1000 poses per second.
enum class Handling : std::uint8_t {
  stab,   ///< straight through the obstacle and back at up to 5 m/s, with a small rotation
  shake,  ///< random motion at up to 5 m/s and 50 rad/s
  press,  ///< in a hole: lateral motion, tilt, and motion along the hole
  slide,  ///< over the top and past its edges
};

/// A tool, an obstacle, and the motion of the tool.
struct ManipulationCase {
  std::string name;
  GeneratedMesh tool, obstacle;
  Handling motion;
  Vector3d start_m;  ///< start position of the tool, without overlap
  BodyKind obstacle_kind = BodyKind::solid;
  bool divides_space = false;  ///< for a surface: MeshBvh::divides_space
};

/// Twenty cases: thin and thick, flat and round, fine and coarse, loose and tight.
const std::vector<ManipulationCase>& manipulation_cases();

/// Returns the scene of a case. motion: the obstacle's motion from its initial pose.
Scene scene_of(const ManipulationCase& handling, const ObstacleMotion& motion = {});

/// Returns a tool without a convex hull, which only half-spaces need. Meshes do not.
ToolBody mesh_tool(TriangleMesh mesh, double mass_kg = 0.1);

/// The commanded poses of the tool's body frame, in sequence.
class HandTrajectory {
 public:
  explicit HandTrajectory(const ManipulationCase& handling, std::uint64_t seed = 1)
      : case_(handling), random_(seed), X_WP_{Quaterniond::Identity(), handling.start_m} {}

  const Pose& next();

 private:
  void stab();
  void shake();
  void press();
  void slide();

  const ManipulationCase& case_;
  RandomValues random_;
  Pose X_WP_;
  double t_s_ = 0.0;
  int ticks_ = 0;
  Twist V_;
};

}  // namespace wrenchd::test
