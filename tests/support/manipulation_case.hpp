// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "collision/meshes/make_mesh.hpp"
#include "collision/scene.hpp"
#include "tests/support/random_values.hpp"

namespace wrenchd::test {

/// How a hand handles a tool, at 1000 poses a second.
enum class HandMotion : std::uint8_t {
  stab,   ///< straight through the obstacle and back, at up to 5 m/s, turning a little
  shake,  ///< at random, at up to 5 m/s and 50 rad/s
  press,  ///< in a hole: from side to side, tilting, in and out
  slide,  ///< over the top and beyond its edges
};

/// A tool, an obstacle, and what is done with them.
struct ManipulationCase {
  std::string name;
  GeneratedMesh tool, obstacle;
  HandMotion motion;
  Vector3d start_m;  ///< of the tool; nothing overlaps there
};

/// Twenty of them: thin and thick, flat and round, fine and coarse, loose and tight.
const std::vector<ManipulationCase>& manipulation_cases();

/// The obstacle may move, from where it stands.
Scene scene_of(const ManipulationCase& handling, const ObstacleMotion& motion = {});

/// A tool for the proxy: half-spaces would need the hull that tool_body() makes, meshes do not.
ToolBody mesh_tool(TriangleMesh mesh, double mass_kg = 0.1);

/// The hand's poses of the tool's body frame, one after the other.
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
