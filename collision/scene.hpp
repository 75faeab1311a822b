// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "collision/tool_body.hpp"
#include "core/convex_body.hpp"
#include "core/scene_settings.hpp"

namespace wrenchd {

/// A convex solid that the tool may touch.
struct ConvexObstacle {
  std::string name;
  ConvexBody body;  ///< in the world
  Vector3d centre_W_m = Vector3d::Zero();
  double radius_m = 0.0;  ///< of a sphere about the centre that holds it
};

/// An obstacle from its hull in the world.
ConvexObstacle convex_obstacle(std::string name, ConvexBody body_W);

/// The tool and the obstacles it may touch. Built once, then only read.
///
/// Obstacles are numbered: the half-spaces first, then the convex ones.
class Scene {
 public:
  /// Throws MeshError where a mesh cannot be used.
  explicit Scene(const SceneSettings& settings);
  Scene(ToolBody tool, std::vector<HalfSpaceSettings> half_spaces, std::vector<ConvexObstacle> convex = {});

  const ToolBody& tool() const noexcept { return tool_; }
  double tool_radius_m() const noexcept { return tool_radius_m_; }
  const std::vector<HalfSpaceSettings>& half_spaces() const noexcept { return half_spaces_; }
  const std::vector<ConvexObstacle>& convex() const noexcept { return convex_; }
  std::size_t obstacle_count() const noexcept { return half_spaces_.size() + convex_.size(); }

 private:
  ToolBody tool_;
  double tool_radius_m_;  ///< farthest vertex of the hull from the centre of mass
  std::vector<HalfSpaceSettings> half_spaces_;
  std::vector<ConvexObstacle> convex_;
};

}  // namespace wrenchd
