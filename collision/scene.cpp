// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/scene.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "collision/bodies/body_placement.hpp"
#include "collision/meshes/convex_hull.hpp"
#include "collision/meshes/mesh_convexity.hpp"

namespace wrenchd {
namespace {

/// The results for one combination of mesh file, scale and kind.
struct LoadedObstacle {
  std::shared_ptr<const LoadedMesh> loaded;
  std::shared_ptr<const MeshBvh> bvh;
  std::optional<ConvexBody> hull;  ///< in file units; empty if the mesh is not convex
};

std::shared_ptr<const LoadedMesh> load(const MeshObstacleSettings& obstacle, MeshLoader& loader) {
  return obstacle.parts.empty() ? loader.load(obstacle.mesh, obstacle.kind, obstacle.generated)
                                : loader.load_parts(obstacle.parts, obstacle.kind);
}

LoadedObstacle make(std::shared_ptr<const LoadedMesh> loaded, const MeshObstacleSettings& obstacle,
                    const SceneSettings& scene, bool all_convex, MeshLoader& loader) {
  LoadedObstacle loaded_obstacle;
  loaded_obstacle.loaded = std::move(loaded);
  loader.check_size(*loaded_obstacle.loaded, obstacle.scale, kPlausibleObstacleSize);
  require_size_for_contacts(loaded_obstacle.loaded->mesh, obstacle.scale, obstacle.mesh);
  TriangleMesh mesh = loaded_obstacle.loaded->mesh;
  if (all_convex && obstacle.kind == BodyKind::solid && !loaded_obstacle.loaded->parts_overlap &&
      may_be_convex(mesh)) {
    ConvexBody hull = loader.hull(*loaded_obstacle.loaded);
    if (is_convex(mesh, hull)) loaded_obstacle.hull = std::move(hull);
  }
  for (Vector3d& p : mesh.vertices_m) p *= obstacle.scale;
  loaded_obstacle.bvh = loader.build_bvh(std::move(mesh), obstacle.kind, obstacle.mesh,
                                         scene.surface_tolerance_m, {scene.smoothing_m});
  return loaded_obstacle;
}

std::shared_ptr<const MeshBvh> tool_surface(const ToolBody& tool, const SceneSettings& settings,
                                            MeshLoader& loader) {
  const bool touches_meshes = !settings.meshes.empty() || !settings.bodies.empty();
  return loader.build_bvh(tool.mesh, tool.kind, settings.tool.mesh, settings.surface_tolerance_m,
                          {settings.smoothing_m, touches_meshes ? Smoothing::kMaxTrianglesForMeshes
                                                                : Smoothing::kMaxTrianglesForHalfSpaces});
}

/// Loads tool and obstacles.
Scene load_obstacles(const SceneSettings& settings, MeshLoader& loader) {
  ToolBody tool = load_tool(settings.tool, loader);
  const bool smooth = settings.smoothing_m > 0.0;
  if (settings.meshes.empty() && !smooth) return Scene(std::move(tool), settings.half_spaces);
  require_size_for_contacts(tool.mesh, 1.0, settings.tool.mesh);
  auto tool_mesh = tool_surface(tool, settings, loader);
  if (smooth) tool.hull = hull_of(*tool_mesh, settings.tool.mesh, loader);

  std::vector<ConvexObstacle> convex;
  std::vector<MeshObstacle> meshes;
  const bool all_at_rest = std::none_of(
      settings.meshes.begin(), settings.meshes.end(),
      [](const MeshObstacleSettings& obstacle) { return obstacle.motion.moves() || obstacle.scheduled; });
  bool all_convex = all_at_rest && !smooth && tool.kind == BodyKind::solid && settings.tool.parts.empty() &&
                    is_convex(tool.mesh, tool.hull);
  std::map<std::pair<const LoadedMesh*, double>, LoadedObstacle> loaded_obstacles;
  for (const MeshObstacleSettings& obstacle : settings.meshes) {
    auto loaded = load(obstacle, loader);
    const auto [at, is_new] = loaded_obstacles.try_emplace({loaded.get(), obstacle.scale});
    LoadedObstacle& loaded_obstacle = at->second;
    if (is_new) loaded_obstacle = make(std::move(loaded), obstacle, settings, all_convex, loader);
    meshes.emplace_back(obstacle.name, loaded_obstacle.bvh, obstacle.X_WM, obstacle.motion,
                        obstacle.scheduled);
    all_convex = all_convex && loaded_obstacle.hull;
    if (!all_convex) continue;
    ConvexBody hull = *loaded_obstacle.hull;
    for (Vector3d& p : hull.vertices_T_m) p = obstacle.X_WM * Vector3d(p * obstacle.scale);
    convex.push_back(convex_obstacle(obstacle.name, std::move(hull)));
  }
  if (!all_convex) convex.clear();
  return Scene(std::move(tool), settings.half_spaces, std::move(convex), std::move(meshes),
               std::move(tool_mesh));
}

/// Loads the meshes of the settings.
Scene load(const SceneSettings& settings, MeshLoader& loader) {
  Scene obstacles = load_obstacles(settings, loader);
  if (settings.bodies.empty()) return obstacles;
  if (!obstacles.tool_mesh()) {
    require_size_for_contacts(obstacles.tool().mesh, 1.0, settings.tool.mesh);
    obstacles = Scene(obstacles.tool(), obstacles.half_spaces(), {}, {},
                      tool_surface(obstacles.tool(), settings, loader));
  }
  std::vector<FreeBody> bodies;
  for (const BodySettings& body : settings.bodies) bodies.push_back(load_free_body(body, settings, loader));
  return {obstacles, placed(std::move(bodies), obstacles, loader), settings.gravity_W_m_per_s2};
}

bool any_moves(const std::vector<MeshObstacle>& meshes) {
  return std::any_of(meshes.begin(), meshes.end(), [](const MeshObstacle& m) { return m.moves(); });
}

double farthest_m(const std::vector<Vector3d>& points, const Vector3d& centre) {
  double squared = 0.0;
  for (const Vector3d& p : points) squared = std::max(squared, (p - centre).squaredNorm());
  return std::sqrt(squared);
}

}  // namespace

ConvexObstacle convex_obstacle(std::string name, ConvexBody body_W) {
  ConvexObstacle obstacle{std::move(name), std::move(body_W)};
  obstacle.body.compute_derived_data();
  for (const Vector3d& p : obstacle.body.vertices_T_m)
    obstacle.centre_W_m += p / static_cast<double>(obstacle.body.vertices_T_m.size());
  obstacle.radius_m = farthest_m(obstacle.body.vertices_T_m, obstacle.centre_W_m);
  return obstacle;
}

MeshObstacle::MeshObstacle(std::string name_, std::shared_ptr<const MeshBvh> mesh_, const Pose& X_WO_,
                           const ObstacleMotion& motion_, const std::optional<ScheduledMotion>& later_)
    : name(std::move(name_)), mesh(std::move(mesh_)), X_WO(X_WO_), motion(motion_), scheduled(later_) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : mesh->surface.vertices_m()) box.extend(p);
  centre_O_m = box.center();
  centre_W_m = X_WO * centre_O_m;
  radius_m = farthest_m(mesh->surface.vertices_m(), centre_O_m);
}

double MeshObstacle::speed_bound_m_per_s() const noexcept {
  const double lever_m = centre_O_m.norm();
  const auto fastest = [lever_m](const ObstacleMotion& m) {
    return m.linear_m_per_s.norm() + m.angular_rad_per_s.norm() * lever_m;
  };
  return scheduled ? std::max(fastest(motion), fastest(scheduled->motion)) : fastest(motion);
}

Scene::Scene(const SceneSettings& settings, MeshLoader& loader) : Scene(load(settings, loader)) {}

Scene::Scene(const SceneSettings& settings) {
  MeshLoader loader;
  *this = Scene(settings, loader);
}

Scene::Scene(ToolBody tool, std::vector<HalfSpaceSettings> half_spaces, std::vector<ConvexObstacle> convex,
             std::vector<MeshObstacle> meshes, std::shared_ptr<const MeshBvh> tool_mesh)
    : tool_(std::move(tool)),
      tool_radius_m_(farthest_m(tool_.hull.vertices_T_m, Vector3d::Zero())),
      half_spaces_(std::move(half_spaces)),
      convex_(std::move(convex)),
      meshes_(std::move(meshes)),
      tool_mesh_(std::move(tool_mesh)),
      has_moving_obstacles_(any_moves(meshes_)) {
  if (has_moving_obstacles_) convex_.clear();
  if (!meshes_.empty() && !tool_mesh_) tool_mesh_ = std::make_shared<const MeshBvh>(tool_.mesh, tool_.kind);
  // A simplified mesh encloses the hull.
  if (tool_mesh_) tool_radius_m_ = std::max(tool_radius_m_, tool_mesh_->surface.radius_m());
}

Scene::Scene(const Scene& other, const std::vector<MeshObstacleSettings>& meshes) : Scene(other) {
  for (std::size_t k = 0; k < meshes_.size(); ++k) {
    MeshObstacle& obstacle = meshes_[k];
    obstacle.X_WO = meshes[k].X_WM;
    obstacle.centre_W_m = obstacle.X_WO * obstacle.centre_O_m;
    obstacle.motion = meshes[k].motion;
    obstacle.scheduled = meshes[k].scheduled;
  }
  has_moving_obstacles_ = any_moves(meshes_);
  convex_.clear();  // convex() holds the previous poses
}

/// The global search knows obstacles only, so convex() is left empty.
Scene::Scene(const Scene& other, std::vector<FreeBody> bodies, const Vector3d& gravity_W_m_per_s2)
    : Scene(other) {
  for (FreeBody& one : bodies)
    if (!one.mesh) one.mesh = std::make_shared<const MeshBvh>(one.body.mesh, one.body.kind);
  if (!tool_mesh_) tool_mesh_ = std::make_shared<const MeshBvh>(tool_.mesh, tool_.kind);
  tool_radius_m_ = std::max(tool_radius_m_, tool_mesh_->surface.radius_m());
  bodies_ = std::make_shared<const std::vector<FreeBody>>(std::move(bodies));
  gravity_W_m_per_s2_ = gravity_W_m_per_s2;
  convex_.clear();
}

Pose Scene::obstacle_displacement(std::uint32_t number, double from_s, double to_s) const noexcept {
  if (from_s == to_s || number < first_mesh() || !meshes_[number - first_mesh()].moves()) return {};
  const MeshObstacle& obstacle = meshes_[number - first_mesh()];
  return obstacle.X_WO_at(to_s) * inverse(obstacle.X_WO_at(from_s));
}

}  // namespace wrenchd
