// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>
#include <sstream>
#include <thread>
#include <vector>

#include "collision/meshes/make_mesh.hpp"
#include "tests/support/shipped_config.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test {

/// The shipped runtime with a boulder of 60 mm around the origin instead of its table. The hand follows the
/// given path once and stays at its end.
struct BuriedTool {
  TemporaryDirectory files;  ///< contains the boulder
  RunConfig config = shipped_config();

  explicit BuriedTool(const std::vector<Waypoint>& path, std::size_t triangles = 2000) {
    std::ostringstream boulder;
    write_off(boulder, make_mesh({"boulder", triangles}));
    config.scene.half_spaces.clear();
    MeshObstacleSettings& obstacle = config.scene.meshes.emplace_back();
    obstacle.name = "boulder";
    obstacle.mesh = files.write("boulder.off", boulder.str());
    config.settings.simulation.hand_path = path;
    config.settings.simulation.hand_repeats = false;
  }
};

/// Walls on six sides of the origin at this distance.
inline std::vector<HalfSpaceSettings> closed_box(double half_m) {
  std::vector<HalfSpaceSettings> walls;
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3d n = Vector3d::Unit(axis);
    walls.push_back({"wall", n, -half_m});
    walls.push_back({"wall", -n, -half_m});
  }
  return walls;
}

inline ProxyInitialization proxy_initialization(const VirtualRuntime& s) {
  return static_cast<ProxyInitialization>(s.last.proxy_initialization);
}

/// Gives a proxy search in the background time to finish while little virtual time passes.
inline void wait_for_proxy_search(const VirtualRuntime& s) {
  if (proxy_initialization(s) == ProxyInitialization::searching)
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
}

}  // namespace wrenchd::test
