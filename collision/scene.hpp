// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "collision/meshes/mesh_bvh.hpp"
#include "collision/meshes/mesh_loader.hpp"
#include "collision/tool_body.hpp"
#include "core/convex_body.hpp"
#include "core/obstacle_motion.hpp"
#include "core/scene_settings.hpp"

namespace wrenchd {

/// A convex solid that the tool may touch.
struct ConvexObstacle {
  std::string name;
  ConvexBody body;  ///< in the world
  Vector3d centre_W_m = Vector3d::Zero();
  double radius_m = 0.0;  ///< of a sphere about the centre that holds it
};

/// An obstacle of any shape. O: the frame of its mesh, in metres.
struct MeshObstacle {
  /// The same mesh may be many obstacles.
  MeshObstacle(std::string name_, std::shared_ptr<const MeshBvh> mesh_, const Pose& X_WO_,
               const ObstacleMotion& motion_ = {}, const std::optional<ScheduledMotion>& later_ = {});
  MeshObstacle(std::string name_, MeshBvh mesh_, const Pose& X_WO_, const ObstacleMotion& motion_ = {})
      : MeshObstacle(std::move(name_), std::make_shared<const MeshBvh>(std::move(mesh_)), X_WO_, motion_) {}

  /// Where it stands at scene time t_s [s]: X_WO until it sets out. RT safe.
  Pose X_WO_at(double t_s) const noexcept {
    return scheduled && t_s >= scheduled->start_s ? scheduled->motion.pose_at(scheduled->X_WO, t_s)
                                                  : motion.pose_at(X_WO, t_s);
  }
  bool moves() const noexcept { return motion.moves() || (scheduled && scheduled->motion.moves()); }
  /// How fast the centre of the sphere that holds it is at most [m/s].
  double speed_bound_m_per_s() const noexcept;

  std::string name;
  std::shared_ptr<const MeshBvh> mesh;
  Pose X_WO;                                 ///< at scene time 0
  ObstacleMotion motion;                     ///< from there
  std::optional<ScheduledMotion> scheduled;  ///< and in the place of that
  Vector3d centre_O_m;                       ///< of a sphere that holds it
  Vector3d centre_W_m;                       ///< the same, at scene time 0
  double radius_m;
};

/// An obstacle from its hull in the world.
ConvexObstacle convex_obstacle(std::string name, ConvexBody body_W);

/// The tool and the obstacles it may touch. Built once, then only read.
///
/// What was given as a mesh is one of meshes(). Where the tool and all of them are convex they are in
/// convex() as well, in the same order: between convex bodies the global optimum can be sought. Not so where
/// an obstacle moves, for that search knows only bodies that stand still: then convex() is empty.
///
/// Obstacles are numbered: the half-spaces first, then the others. Where they stand at which scene time is a
/// law (core/obstacle_motion.hpp): a scene has no state.
class Scene {
 public:
  /// Reads the meshes. Throws MeshError where one cannot be used; what else there is to say of them is left
  /// with the loader.
  Scene(const SceneSettings& settings, MeshLoader& loader);
  explicit Scene(const SceneSettings& settings);  ///< with a loader of its own, that keeps nothing
  /// tool_mesh: the tool's own mesh, where it is at hand already.
  Scene(ToolBody tool, std::vector<HalfSpaceSettings> half_spaces, std::vector<ConvexObstacle> convex = {},
        std::vector<MeshObstacle> meshes = {}, std::shared_ptr<const MeshBvh> tool_mesh = nullptr);

  /// The same bodies, the meshes where these settings have them; there is one for each. Nothing is read.
  Scene(const Scene& other, const std::vector<MeshObstacleSettings>& meshes);

  const ToolBody& tool() const noexcept { return tool_; }
  double tool_radius_m() const noexcept { return tool_radius_m_; }
  const std::vector<HalfSpaceSettings>& half_spaces() const noexcept { return half_spaces_; }
  const std::vector<ConvexObstacle>& convex() const noexcept { return convex_; }
  const std::vector<MeshObstacle>& meshes() const noexcept { return meshes_; }
  /// The tool as the meshes meet it, in T; null where there are none.
  const MeshBvh* tool_mesh() const noexcept { return tool_mesh_.get(); }
  bool has_moving_obstacles() const noexcept { return has_moving_obstacles_; }  ///< does any obstacle?
  /// By how much an obstacle moves in the world from one scene time to another: X_WO then = this * X_WO
  /// before. number: as above. RT safe.
  Pose obstacle_displacement(std::uint32_t number, double from_s, double to_s) const noexcept;
  std::size_t obstacle_count() const noexcept {
    return half_spaces_.size() + std::max(convex_.size(), meshes_.size());
  }
  /// The number of the first of meshes(); the others follow.
  std::uint32_t first_mesh() const noexcept {
    return static_cast<std::uint32_t>(obstacle_count() - meshes_.size());
  }

 private:
  ToolBody tool_;
  double tool_radius_m_;  ///< farthest vertex of the hull from the centre of mass
  std::vector<HalfSpaceSettings> half_spaces_;
  std::vector<ConvexObstacle> convex_;
  std::vector<MeshObstacle> meshes_;
  std::shared_ptr<const MeshBvh> tool_mesh_;
  bool has_moving_obstacles_ = false;
};

}  // namespace wrenchd
