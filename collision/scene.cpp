// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/scene.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <utility>

#include "collision/convex_hull.hpp"
#include "collision/mesh_solid.hpp"

namespace wrenchd {
namespace {

/// Reads what the settings name.
Scene load(const SceneSettings& settings) {
  ToolBody tool = load_tool(settings.tool);
  std::vector<TriangleMesh> solids;
  std::vector<ConvexBody> hulls;
  bool all_convex = !settings.meshes.empty() && fills_its_hull(tool.mesh, tool.hull);
  for (const MeshObstacleSettings& obstacle : settings.meshes) {
    solids.push_back(load_solid(obstacle.mesh));
    if (!all_convex) continue;
    hulls.push_back(convex_hull(solids.back().vertices_m));
    all_convex = fills_its_hull(solids.back(), hulls.back());
  }
  std::vector<ConvexObstacle> convex;
  std::vector<MeshObstacle> meshes;
  std::map<std::pair<std::filesystem::path, double>, std::shared_ptr<const TreedMesh>> made;
  for (std::size_t k = 0; k < solids.size(); ++k) {
    const auto& [name, file, scale, X_WM] = settings.meshes[k];
    std::shared_ptr<const TreedMesh>& mesh = made[{file, scale}];
    if (!mesh) {
      for (Vector3d& p : solids[k].vertices_m) p *= scale;
      mesh = std::make_shared<const TreedMesh>(std::move(solids[k]));
    }
    meshes.emplace_back(name, mesh, X_WM);
    if (!all_convex) continue;
    for (Vector3d& p : hulls[k].vertices_T_m) p = X_WM * Vector3d(p * scale);
    convex.push_back(convex_obstacle(name, std::move(hulls[k])));
  }
  return Scene(std::move(tool), settings.half_spaces, std::move(convex), std::move(meshes));
}

double farthest_m(const std::vector<Vector3d>& points, const Vector3d& centre) {
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
  obstacle.radius_m = farthest_m(obstacle.body.vertices_T_m, obstacle.centre_W_m);
  return obstacle;
}

MeshObstacle::MeshObstacle(std::string name_, std::shared_ptr<const TreedMesh> mesh_, const Pose& X_WO_)
    : name(std::move(name_)), mesh(std::move(mesh_)), X_WO(X_WO_) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : mesh->surface.vertices_m()) box.extend(p);
  centre_W_m = X_WO * box.center();
  radius_m = farthest_m(mesh->surface.vertices_m(), box.center());
}

TreedMesh::TreedMesh(TriangleMesh mesh, MeshSurface::Kind kind)
    : surface(std::move(mesh), kind), tree(surface) {}

Scene::Scene(const SceneSettings& settings) : Scene(load(settings)) {}

Scene::Scene(ToolBody tool, std::vector<HalfSpaceSettings> half_spaces, std::vector<ConvexObstacle> convex,
             std::vector<MeshObstacle> meshes)
    : tool_(std::move(tool)),
      tool_radius_m_(farthest_m(tool_.hull.vertices_T_m, Vector3d::Zero())),
      half_spaces_(std::move(half_spaces)),
      convex_(std::move(convex)),
      meshes_(std::move(meshes)) {
  if (!meshes_.empty()) tool_mesh_.emplace(tool_.mesh);
}

}  // namespace wrenchd
