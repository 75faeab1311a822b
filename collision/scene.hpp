// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "collision/bodies/free_body.hpp"
#include "collision/meshes/mesh_bvh.hpp"
#include "collision/meshes/mesh_loader.hpp"
#include "collision/tool_body.hpp"
#include "core/convex_body.hpp"
#include "core/obstacle_motion.hpp"
#include "core/scene_settings.hpp"

namespace wrenchd {

/// A convex solid obstacle.
struct ConvexObstacle {
  std::string name;
  ConvexBody body;  ///< hull in the world W
  Vector3d centre_W_m = Vector3d::Zero();
  double radius_m = 0.0;  ///< radius of a sphere about centre_W_m that contains the body
};

/// An obstacle of any shape. O: frame of its mesh, in metres.
struct MeshObstacle {
  /// Several obstacles may share one mesh.
  MeshObstacle(std::string name_, std::shared_ptr<const MeshBvh> mesh_, const Pose& X_WO_,
               const ObstacleMotion& motion_ = {}, const std::optional<ScheduledMotion>& later_ = {});
  MeshObstacle(std::string name_, MeshBvh mesh_, const Pose& X_WO_, const ObstacleMotion& motion_ = {})
      : MeshObstacle(std::move(name_), std::make_shared<const MeshBvh>(std::move(mesh_)), X_WO_, motion_) {}

  /// Returns the pose of the obstacle at scene time t_s [s]. RT-safe.
  Pose X_WO_at(double t_s) const noexcept {
    return scheduled && t_s >= scheduled->start_s ? scheduled->motion.pose_at(scheduled->X_WO, t_s)
                                                  : motion.pose_at(X_WO, t_s);
  }
  bool moves() const noexcept { return motion.moves() || (scheduled && scheduled->motion.moves()); }
  /// Returns an upper bound for the speed of the bounding sphere's centre [m/s]. RT-safe.
  double speed_bound_m_per_s() const noexcept;

  std::string name;
  std::shared_ptr<const MeshBvh> mesh;
  Pose X_WO;                                 ///< pose at scene time 0
  ObstacleMotion motion;                     ///< motion from X_WO on
  std::optional<ScheduledMotion> scheduled;  ///< motion that replaces `motion` from its start time on
  Vector3d centre_O_m;                       ///< centre of a bounding sphere, in O
  Vector3d centre_W_m;                       ///< centre of the bounding sphere at scene time 0, in W
  double radius_m;
};

/// Makes an obstacle from its hull in the world. Not RT-safe: allocates.
ConvexObstacle convex_obstacle(std::string name, ConvexBody body_W);

/// The tool and its obstacles. Immutable after construction.
///
/// Every mesh obstacle is one of meshes(). If the tool and all obstacles are convex, convex() holds them too,
/// in the same order. Only between convex bodies at rest can the global optimum be searched. So convex() is
/// empty if an obstacle moves.
///
/// Obstacle numbers count the half-spaces first, then the other obstacles. The pose of an obstacle is a
/// function of scene time (core/obstacle_motion.hpp). A scene has no state. Constructors are not RT-safe:
/// they allocate. Accessors are RT-safe.
class Scene {
 public:
  /// Reads the meshes. Throws MeshError if a mesh cannot be used. The loader collects warnings. Not RT-safe:
  /// reads files, may take seconds.
  Scene(const SceneSettings& settings, MeshLoader& loader);
  explicit Scene(const SceneSettings& settings);  ///< uses a loader without a cache
  /// tool_mesh: BVH of the tool's mesh if it already exists, otherwise null. Not RT-safe: may take seconds.
  Scene(ToolBody tool, std::vector<HalfSpaceSettings> half_spaces, std::vector<ConvexObstacle> convex = {},
        std::vector<MeshObstacle> meshes = {}, std::shared_ptr<const MeshBvh> tool_mesh = nullptr);

  /// Copies `other` with the mesh obstacles at the poses and motions of `meshes`, one entry for each. Reads
  /// no file. Not RT-safe: allocates.
  Scene(const Scene& other, const std::vector<MeshObstacleSettings>& meshes);

  /// Copies `other` with bodies that move by themselves, at admissible poses. gravity: acts on them. Not
  /// RT-safe: allocates.
  Scene(const Scene& other, std::vector<FreeBody> bodies, const Vector3d& gravity_W_m_per_s2);

  const ToolBody& tool() const noexcept { return tool_; }
  double tool_radius_m() const noexcept { return tool_radius_m_; }
  const std::vector<HalfSpaceSettings>& half_spaces() const noexcept { return half_spaces_; }
  const std::vector<ConvexObstacle>& convex() const noexcept { return convex_; }
  const std::vector<MeshObstacle>& meshes() const noexcept { return meshes_; }
  /// BVH of the tool's mesh in T; null if the scene has neither mesh obstacles nor bodies.
  const MeshBvh* tool_mesh() const noexcept { return tool_mesh_.get(); }
  const std::shared_ptr<const MeshBvh>& shared_tool_mesh() const noexcept { return tool_mesh_; }
  /// The bodies that move by themselves, at their start. They are no obstacles of this scene; BodyWorld moves
  /// them.
  const std::vector<FreeBody>& bodies() const noexcept { return *bodies_; }
  const Vector3d& gravity_W_m_per_s2() const noexcept { return gravity_W_m_per_s2_; }
  /// True if both scenes have the same bodies: one is a copy of the other. RT-safe.
  bool shares_bodies_with(const Scene& other) const noexcept { return bodies_ == other.bodies_; }
  /// true if any obstacle moves
  bool has_moving_obstacles() const noexcept { return has_moving_obstacles_; }
  /// Returns the displacement of an obstacle in the world between two scene times [s]: X_WO(to) =
  /// displacement * X_WO(from). number: obstacle number. RT-safe.
  Pose obstacle_displacement(std::uint32_t number, double from_s, double to_s) const noexcept;
  std::size_t obstacle_count() const noexcept {
    return half_spaces_.size() + std::max(convex_.size(), meshes_.size());
  }
  /// Obstacle number of the first of meshes(). The others follow.
  std::uint32_t first_mesh() const noexcept {
    return static_cast<std::uint32_t>(obstacle_count() - meshes_.size());
  }

 private:
  ToolBody tool_;
  double tool_radius_m_;  ///< largest distance of a point of the tool from the centre of mass [m]
  std::vector<HalfSpaceSettings> half_spaces_;
  std::vector<ConvexObstacle> convex_;
  std::vector<MeshObstacle> meshes_;
  std::shared_ptr<const MeshBvh> tool_mesh_;
  std::shared_ptr<const std::vector<FreeBody>> bodies_ = std::make_shared<const std::vector<FreeBody>>();
  Vector3d gravity_W_m_per_s2_ = Vector3d::Zero();
  bool has_moving_obstacles_ = false;
};

}  // namespace wrenchd
