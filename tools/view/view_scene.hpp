// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/obstacle_motion.hpp"
#include "core/pose.hpp"
#include "daemon/control/json_rpc.hpp"

namespace wrenchd {

/// A scene prepared for the page, from the daemon's response to `scene.geometry`. Immutable after
/// construction. Not RT-safe: allocates; large meshes take seconds.
class ViewScene {
 public:
  /// Maximum number of triangles of all meshes together. Larger scenes are simplified.
  static constexpr std::size_t kMaxTriangles = 150'000;
  /// Maximum number of triangles while something moves, on machines that draw slowly.
  static constexpr std::size_t kReducedTriangles = 15'000;

  /// description, bytes: the two parts of SceneGeometry. known: a scene whose meshes can be reused; may be
  /// null. Throws std::runtime_error if description and bytes do not match.
  ViewScene(const Json& description, std::span<const std::byte> bytes, const ViewScene* known = nullptr);

  std::uint64_t shapes() const noexcept { return shapes_; }
  std::uint32_t rendering_id() const noexcept { return rendering_id_; }

  /// Returns {type: "scene", tool, obstacles, ...}: the mesh and pose of tool, obstacles and bodies.
  const std::string& text() const noexcept { return text_; }
  /// Returns one binary message per mesh, then one per simplified mesh if necessary. Layout: u32: 1 (full) or
  /// 3 (simplified), mesh number, number of vertices, of triangles, of line points; floats: positions and
  /// normals of the vertices; u32: indices of the triangles; floats: line points.
  const std::vector<std::shared_ptr<const std::string>>& meshes() const noexcept { return meshes_; }

  /// Returns the poses of moving obstacles at this time (CLOCK_MONOTONIC) and of the bodies: [[number, pose],
  /// ...]. Bodies are numbered after the obstacles. X_WB: TickRecord::X_WB.
  Json moved_poses(std::int64_t time_ns, std::span<const double> X_WB) const;
  std::string obstacle_name(std::uint32_t number) const;

  const Pose& X_WB() const noexcept { return X_WB_; }
  const Pose& X_HT() const noexcept { return X_HT_; }
  bool wrench_about_handle() const noexcept { return about_handle_; }

 private:
  struct MovingObstacle {
    std::uint32_t number;
    Pose X_WO;
    ObstacleMotion motion;
    std::optional<ScheduledMotion> later;
  };

  std::uint64_t shapes_ = 0;
  std::uint32_t rendering_id_ = 0;
  std::int64_t start_ns_ = 0;
  std::string text_;
  std::vector<std::shared_ptr<const std::string>> meshes_;
  std::vector<std::size_t> source_triangles_;  ///< number of triangles of each mesh before simplification
  std::vector<std::string> names_;
  std::vector<MovingObstacle> moving_obstacles_;
  std::size_t first_body_ = 0;  ///< number of the first body
  std::size_t body_count_ = 0;
  Pose X_WB_, X_HT_;
  bool about_handle_ = true;
};

}  // namespace wrenchd
