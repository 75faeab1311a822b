// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/clear_start.hpp"

#include <algorithm>
#include <vector>

#include "collision/bodies/body_placement.hpp"
#include "collision/feasible_pose_search.hpp"
#include "core/state_machine.hpp"
#include "devices/simulation/hand_path.hpp"

namespace wrenchd {
namespace {

/// The tool must be clear until the loop is armed: self-test, calm time, soft start, and this.
constexpr double kMargin_s = 0.2;
constexpr double kSampling_s = 0.1;
constexpr double kStep_m = 5e-3;
constexpr int kSteps = 200;

/// Poses of the tool along the path, until the loop is armed.
std::vector<Pose> poses_until_armed(const Scene& scene, const Settings& settings) {
  const Pose X_WB = settings.device.base_in_world.pose();
  const Pose X_HT = settings.device.tool_in_handle.pose() * scene.tool().X_MT();
  const HandPath path(settings.simulation);
  const double armed_s =
      settings.servo.self_test_s + kCalmDuration_s + settings.limits.soft_start_s + kMargin_s;
  std::vector<Pose> poses;
  for (double t_s = 0.0; t_s <= armed_s; t_s += kSampling_s)
    poses.push_back(X_WB * path.at(from_seconds(t_s)).X_BG * X_HT);
  return poses;
}

}  // namespace

std::optional<Vector3d> displacement_to_clear_start(const Scene& given, const Settings& settings) {
  const Scene scene = given.bodies().empty() ? given : with_bodies_as_obstacles(given);
  const std::vector<Pose> poses = poses_until_armed(scene, settings);
  FeasiblePoseSearch search(scene, settings.rendering.contacts);
  const auto clear = [&](const Vector3d& d_W_m) {
    return std::all_of(poses.begin(), poses.end(), [&](const Pose& X_WT) {
      return search.admissible({X_WT.rotation, X_WT.translation_m + d_W_m});
    });
  };
  if (search.admissible(poses.front())) return Vector3d(Vector3d::Zero());
  const Projection nearest = search.nearest(poses.front());
  if (nearest.status == ProjectionStatus::infeasible) return {};
  // The nearest pose may be rotated, and the path is not: the way continues until the tool is clear.
  const Vector3d out_W_m = nearest.X_WQ.translation_m - poses.front().translation_m;
  const double depth_m = out_W_m.norm();
  if (!(depth_m > 0.0)) return {};
  for (int i = 1; i <= kSteps; ++i) {
    const Vector3d d_W_m = (depth_m + i * kStep_m) / depth_m * out_W_m;
    if (clear(d_W_m)) return Vector3d(settings.device.base_in_world.pose().rotation.conjugate() * d_W_m);
  }
  return {};
}

}  // namespace wrenchd
