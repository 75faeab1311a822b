// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/scene.hpp"

#include <algorithm>
#include <cmath>

#include "collision/convex_hull.hpp"
#include "collision/mesh_solid.hpp"

namespace wrenchd {
namespace {

std::vector<ConvexObstacle> load_obstacles(const SceneSettings& settings) {
  std::vector<ConvexObstacle> obstacles;
  for (const MeshObstacleSettings& obstacle : settings.meshes) {
    const TriangleMesh solid = load_solid(obstacle.mesh);
    ConvexBody body = convex_hull(solid.vertices_m);
    require_convex(obstacle.mesh, solid, body);
    for (Vector3d& p : body.vertices_T_m) p = obstacle.X_WM * Vector3d(p * obstacle.scale);
    obstacles.push_back(convex_obstacle(obstacle.name, std::move(body)));
  }
  return obstacles;
}

/// Half-spaces feel no more of the tool than its hull; convex obstacles would.
ToolBody load_tool_for(const SceneSettings& settings) {
  ToolBody tool = load_tool(settings.tool);
  if (!settings.meshes.empty()) {
    const TriangleMesh solid = load_solid(settings.tool.mesh);
    require_convex(settings.tool.mesh, solid, convex_hull(solid.vertices_m));
  }
  return tool;
}

double radius_m(const std::vector<Vector3d>& points, const Vector3d& centre) {
  double squared = 0.0;
  for (const Vector3d& p : points) squared = std::max(squared, (p - centre).squaredNorm());
  return std::sqrt(squared);
}

}  // namespace

ConvexObstacle convex_obstacle(std::string name, ConvexBody body_W) {
  ConvexObstacle obstacle{std::move(name), std::move(body_W)};
  obstacle.body.find_faces();
  for (const Vector3d& p : obstacle.body.vertices_T_m)
    obstacle.centre_W_m += p / static_cast<double>(obstacle.body.vertices_T_m.size());
  obstacle.radius_m = radius_m(obstacle.body.vertices_T_m, obstacle.centre_W_m);
  return obstacle;
}

Scene::Scene(const SceneSettings& settings)
    : Scene(load_tool_for(settings), settings.half_spaces, load_obstacles(settings)) {}

Scene::Scene(ToolBody tool, std::vector<HalfSpaceSettings> half_spaces, std::vector<ConvexObstacle> convex)
    : tool_(std::move(tool)),
      tool_radius_m_(radius_m(tool_.hull.vertices_T_m, Vector3d::Zero())),
      half_spaces_(std::move(half_spaces)),
      convex_(std::move(convex)) {}

}  // namespace wrenchd
