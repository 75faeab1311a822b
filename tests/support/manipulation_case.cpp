// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/manipulation_case.hpp"

#include <algorithm>
#include <cmath>

namespace wrenchd::test {

const std::vector<ManipulationCase>& manipulation_cases() {
  using enum Handling;
  static const std::vector<ManipulationCase> all = {
      {"cube through a plate", {"cube", 12}, {"plate", 12}, stab, {0, 0, 0.05}},
      {"fine cube through a fine plate", {"cube", 1200}, {"plate", 5000}, stab, {0, 0, 0.05}},
      {"bumpy body through a plate", {"bumpy", 2000}, {"plate", 500}, stab, {0, 0, 0.06}},
      {"bolt through a plate", {"bolt", 2000}, {"plate", 100}, stab, {0, 0, 0.04}},
      {"plate through a cube", {"plate", 12}, {"cube", 12}, stab, {0, 0, 0.07}},
      {"gear through a plate", {"gear", 2000}, {"plate", 12}, stab, {0, 0, 0.05}},
      {"plate through a plate", {"plate", 100}, {"plate", 12}, stab, {0, 0, 0.06}},
      {"bumpy body against a boulder", {"bumpy", 2000}, {"boulder", 2000}, shake, {0.11, 0, 0}},
      {"cube against a cube", {"cube", 12}, {"cube", 12}, shake, {0.08, 0, 0}},
      {"fine cube against a fine cube", {"cube", 300}, {"cube", 1200}, shake, {0.08, 0, 0}},
      {"plate against a plate", {"plate", 100}, {"plate", 100}, shake, {0, 0, 0.06}},
      {"gear against a gear", {"gear", 1000}, {"gear", 1000}, shake, {0.05, 0, 0}},
      {"bolt and nut", {"bolt", 2000}, {"nut", 2000}, shake, {0, 0, 0.03}},
      {"sphere in a hole", {"sphere", 320}, {"hole", 1000}, shake, {0, 0, 0.0705}},
      {"peg shaken in its hole", {"peg", 400}, {"hole", 800}, shake, {0, 0, 0}},
      {"peg pressed into its hole", {"peg", 2000}, {"hole", 4000}, press, {0, 0, 0}},
      {"cube over the edges of a table", {"cube", 12}, {"table", 12}, slide, {0.12, 0, 0.04}},
      {"fine cube over the edges of a fine table", {"cube", 300}, {"table", 1200}, slide, {0.12, 0, 0.04}},
      {"gear over the edges of a plate", {"gear", 2000}, {"plate", 300}, slide, {0.03, 0, 0.016}},
      {"bumpy body over a gear", {"bumpy", 1000}, {"gear", 2000}, slide, {0, 0, 0.054}},
  };
  return all;
}

ToolBody mesh_tool(TriangleMesh mesh, double mass_kg) {
  ToolBody tool;
  tool.solid = solid_properties(mesh, mass_kg);
  for (Vector3d& p : mesh.vertices_m) p -= tool.solid.p_MT_m;
  tool.hull.vertices_T_m = mesh.vertices_m;
  tool.mesh = std::move(mesh);
  return tool;
}

Scene scene_of(const ManipulationCase& handling, const ObstacleMotion& motion) {
  MeshBvh obstacle(make_mesh(handling.obstacle), handling.obstacle_kind);
  obstacle.divides_space = handling.divides_space;
  std::vector<MeshObstacle> obstacles;
  obstacles.push_back({handling.obstacle.kind, std::move(obstacle), Pose{}, motion});
  return Scene(mesh_tool(make_mesh(handling.tool)), {}, {}, std::move(obstacles));
}

const Pose& HandTrajectory::next() {
  ++ticks_;
  t_s_ += 1e-3;
  switch (case_.motion) {
    case Handling::stab:
      stab();
      break;
    case Handling::shake:
      shake();
      break;
    case Handling::press:
      press();
      break;
    case Handling::slide:
      slide();
      break;
  }
  return X_WP_;
}

/// Moves down and up again: every second stab at 5 m/s, the others at a quarter of that.
void HandTrajectory::stab() {
  const double depth_m = 2.0 * case_.start_m.norm();
  const bool fast = std::fmod(t_s_, 0.4) < 0.2;
  const double period_s = 2.0 * depth_m / (fast ? 5.0 : 1.25);
  const double phase = std::fmod(t_s_, period_s) / period_s;
  const double down = phase < 0.5 ? 2.0 * phase : 2.0 - 2.0 * phase;
  X_WP_.translation_m = case_.start_m * (1.0 - 2.0 * down) +
                        Vector3d(0.02 * std::sin(3.0 * t_s_), 0.02 * std::sin(2.3 * t_s_), 0.0);
  X_WP_.rotation = rotation_from(0.5 * std::sin(5.0 * t_s_) * Vector3d(0.94, 0.28, 0.19));
}

/// Random velocities up to the fastest of a hand, around a position half way into the obstacle.
void HandTrajectory::shake() {
  if (ticks_ % 20 == 1) {
    const double vigour = ticks_ % 200 == 1 ? 5.0 : 1.0;
    V_.linear_m_per_s = vigour * random_.uniform(0.2, 1.0) * random_.unit<3>();
    V_.angular_rad_per_s = 10.0 * vigour * random_.uniform(0.2, 1.0) * random_.unit<3>();
  }
  X_WP_.translation_m += 1e-3 * V_.linear_m_per_s;
  X_WP_.rotation = (X_WP_.rotation * rotation_from(1e-3 * V_.angular_rad_per_s)).normalized();
  const Vector3d middle_m = 0.5 * case_.start_m;
  const double roam_m = 0.01 + 0.4 * case_.start_m.norm();
  const Vector3d strayed_m = X_WP_.translation_m - middle_m;
  const double pull = std::min(1.0, 1e-3 + std::max(0.0, strayed_m.norm() / roam_m - 1.0));
  X_WP_.translation_m -= pull * strayed_m;
}

void HandTrajectory::press() {
  const double t = t_s_;
  X_WP_.translation_m = {0.001 * std::cos(4.0 * t), 0.001 * std::sin(5.0 * t), 0.01 * std::sin(5.0 * t)};
  X_WP_.rotation =
      rotation_from(0.01 * std::sin(6.0 * t) * Vector3d(std::cos(3.0 * t), std::sin(3.0 * t), 0.0)) *
      rotation_from(Vector3d(0.0, 0.0, 2.0 * t));
}

void HandTrajectory::slide() {
  const double t = t_s_;
  X_WP_.translation_m = case_.start_m + Vector3d(0.06 * std::sin(4.0 * t), 0.03 * std::sin(2.7 * t),
                                                 -0.010 - 0.006 * std::sin(1.3 * t));
  X_WP_.rotation =
      rotation_from(0.1 * std::sin(6.0 * t) * Vector3d(std::cos(3.0 * t), std::sin(3.0 * t), 0.0)) *
      rotation_from(Vector3d(0.0, 0.0, t));
}

}  // namespace wrenchd::test
