// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/bodies/body_placement.hpp"

#include <array>
#include <cstdio>
#include <utility>

#include "collision/meshes/mesh_source.hpp"
#include "collision/penetration.hpp"
#include "collision/proxy.hpp"

namespace wrenchd {
namespace {

std::string millimetres(double length_m) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.3g mm", 1e3 * length_m);
  return text.data();
}

MeshObstacle as_obstacle(const FreeBody& body, const Pose& X_WB) {
  return {body.name, body.mesh, X_WB};
}

}  // namespace

std::vector<FreeBody> placed(std::vector<FreeBody> bodies, const Scene& obstacles, MeshLoader& loader) {
  std::vector<MeshObstacle> placed_so_far = obstacles.meshes();
  for (FreeBody& body : bodies) {
    const Scene scene(body.body, obstacles.half_spaces(), {}, placed_so_far, body.mesh);
    PenetrationDepth::Options options;
    options.clearance_m = Proxy::kClearance_m;
    const Projection nearest = PenetrationDepth(scene, options).query(body.motion.X_WB).projection;
    if (nearest.status == ProjectionStatus::infeasible)
      throw MeshError(
          "the body '" + body.name +
          "' overlaps an obstacle or a body before it, and no free place is near; give it another "
          "position_m");
    const double moved_m = (nearest.X_WQ.translation_m - body.motion.X_WB.translation_m).norm();
    if (moved_m > kPlacement_m)
      loader.add_change("the body '" + body.name + "' overlaps an obstacle or a body before it; it starts " +
                        millimetres(moved_m) + " from there, at the nearest free pose");
    body.motion.X_WB = nearest.X_WQ;
    placed_so_far.push_back(as_obstacle(body, body.motion.X_WB));
  }
  return bodies;
}

Scene with_bodies_as_obstacles(const Scene& scene, std::span<const Pose> X_WB) {
  std::vector<MeshObstacle> meshes = scene.meshes();
  for (std::size_t i = 0; i < scene.bodies().size(); ++i)
    meshes.push_back(as_obstacle(scene.bodies()[i], X_WB[i]));
  return {scene.tool(), scene.half_spaces(), {}, std::move(meshes), scene.shared_tool_mesh()};
}

Scene with_bodies_as_obstacles(const Scene& scene) {
  std::vector<Pose> starts;
  for (const FreeBody& body : scene.bodies()) starts.push_back(body.motion.X_WB);
  return with_bodies_as_obstacles(scene, starts);
}

}  // namespace wrenchd
