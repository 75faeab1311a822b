// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "collision/scene.hpp"
#include "core/triangle_mesh.hpp"
#include "tests/bench/overlap.hpp"

namespace wrenchd::bench {

/// A convex tool that slides and rotates on a larger convex obstacle, with the commanded poses p of its body
/// frame, 1 ms apart. The tool circles at about 0.1 m/s, rotates at 1 to 2.4 rad/s, and is 0.1 to 0.9 mm
/// deep.
struct ConvexPair {
  std::string name;
  Scene scene;
  TriangleMesh tool_T, obstacle_W;  ///< surfaces of the same solids, as input for the peers
  ConvexSurface tool_surface_T, obstacle_surface_W;
  std::vector<Pose> X_WP;
  std::vector<double> depth_m;  ///< exact translational penetration depth at each pose
};

/// vertices: number per body. 8 gives cubes of 60 and 96 mm. Larger numbers give points on ellipsoids with
/// half-axes (1, 0.8, 0.6) times 35 and 55 mm.
ConvexPair sliding_pair(std::size_t vertices, std::size_t poses);

}  // namespace wrenchd::bench
