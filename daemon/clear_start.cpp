// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/clear_start.hpp"

#include "collision/feasible_pose_search.hpp"

namespace wrenchd {
namespace {

/// Gap that the displaced start leaves: the hand comes to rest before it touches.
constexpr double kGap_m = 5e-3;

}  // namespace

std::optional<Vector3d> displacement_to_clear_start(const Scene& scene, const Settings& settings,
                                                    const Pose& X_BH) {
  const Pose X_WB = settings.device.base_in_world.pose();
  const Pose X_WT = X_WB * X_BH * settings.device.tool_in_handle.pose() * scene.tool().X_MT();
  FeasiblePoseSearch search(scene, settings.rendering.contacts);
  if (search.admissible(X_WT)) return Vector3d(Vector3d::Zero());
  const Projection nearest = search.nearest(X_WT);
  if (nearest.status == ProjectionStatus::infeasible) return {};
  // The nearest pose may be rotated, and the path is not: the way continues until the tool is clear.
  Vector3d d_W_m = nearest.X_WQ.translation_m - X_WT.translation_m;
  const double depth_m = d_W_m.norm();
  if (!(depth_m > 0.0)) return {};
  const Vector3d direction = d_W_m / depth_m;
  constexpr int kSteps = 50;
  for (int i = 1; i <= kSteps; ++i) {
    d_W_m = (depth_m * (1.0 + 0.1 * (i - 1)) + kGap_m) * direction;
    if (search.admissible({X_WT.rotation, X_WT.translation_m + d_W_m}))
      return Vector3d(X_WB.rotation.conjugate() * d_W_m);
  }
  return {};
}

}  // namespace wrenchd
