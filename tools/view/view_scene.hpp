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

/// A scene as the page gets it: what `scene.shapes` of the daemon answers, made ready to be drawn. Then it is
/// only read.
class ViewScene {
 public:
  /// Triangles of all meshes together; what has more is made coarser.
  static constexpr std::size_t kMaxTriangles = 150'000;
  /// Of the same, for machines that draw slowly, while something moves.
  static constexpr std::size_t kReducedTriangles = 15'000;

  /// description, bytes: of SceneGeometry. known: one whose meshes are these, if any. Throws
  /// std::runtime_error where the two do not fit to each other.
  ViewScene(const Json& description, std::span<const std::byte> bytes, const ViewScene* known = nullptr);

  std::uint64_t shapes() const noexcept { return shapes_; }
  std::uint32_t rendering_id() const noexcept { return rendering_id_; }

  /// {type: "scene", tool, obstacles, ...}: which mesh is whose, and where it stands.
  const std::string& text() const noexcept { return text_; }
  /// A binary message for each mesh, and where that is much, after them another for each that is coarser: u32
  /// 1 or 3, number, how many corners, triangles, points of lines; then floats: positions and normals of the
  /// corners; u32: corners of the triangles; floats: points of the lines.
  const std::vector<std::shared_ptr<const std::string>>& meshes() const noexcept { return meshes_; }

  /// Where the obstacles that move stand at this time (CLOCK_MONOTONIC): [[number, pose], ...].
  Json moving_obstacle_poses(std::int64_t time_ns) const;
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
  std::vector<std::size_t> source_triangles_;  ///< triangles of each mesh
  std::vector<std::string> names_;
  std::vector<MovingObstacle> moving_obstacles_;
  Pose X_WB_, X_HT_;
  bool about_handle_ = true;
};

}  // namespace wrenchd
