// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/paper_examples.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/triangle_mesh.hpp"
#include "core/wrench_law.hpp"

namespace wrenchd {
namespace {

constexpr double kSide = 50.0;
constexpr double kCubeMass_kg = 1.0;
constexpr double kStep_s = 0.05;
constexpr int kSteps = 120;

/// A cube about the origin. The bits of a corner's number select its x, y and z.
TriangleMesh cube() {
  TriangleMesh mesh;
  for (int corner = 0; corner < 8; ++corner)
    mesh.vertices_m.emplace_back((corner & 1) != 0 ? 0.5 : -0.5, (corner & 2) != 0 ? 0.5 : -0.5,
                                 (corner & 4) != 0 ? 0.5 : -0.5);
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

/// Eq. (16) unchanged: the integral has no limit, and the derivative is a finite difference.
WrenchGains paper_gains() {
  WrenchGains gains;
  gains.stiffness = WrenchGains::scalar(1.0);
  gains.integral = WrenchGains::scalar(0.5);
  gains.damping = WrenchGains::scalar(0.1);
  gains.integral_limit_N = std::numeric_limits<double>::infinity();
  gains.integral_limit_Nm = std::numeric_limits<double>::infinity();
  gains.derivative_cutoff_Hz = std::numeric_limits<double>::infinity();
  return gains;
}

/// A free rigid body, in its own axes at its centre of mass (Newton and Euler):
///
///   m (dv/dt + w x v) = f        H dw/dt + w x (H w) = tau
///
/// One semi-implicit step: first the velocity, then the pose with the new velocity.
void move(const Inertia& M, const Wrench& F_T, Twist& V, Pose& X_WP) {
  const Vector3d w = V.angular_rad_per_s;
  const Vector3d v = V.linear_m_per_s;
  V.linear_m_per_s += kStep_s * (F_T.force_N / M.mass_kg - w.cross(v));
  V.angular_rad_per_s += kStep_s * M.H_kg_m2.inverse() * (F_T.torque_Nm - w.cross(M.H_kg_m2 * w));
  Vector6d xi;
  xi << kStep_s * V.linear_m_per_s, kStep_s * V.angular_rad_per_s;
  X_WP = X_WP * exp(xi);
}

}  // namespace

Scene paper_scene(double scale) {
  return {tool_body(cube(), scale * kSide, kCubeMass_kg), {{"plane", Vector3d::UnitY(), 0.0}}};
}

Pose pose_of_example_4_1(double scale) {
  return {rotation_from({0.0, 0.0, -0.2}), {0.0, scale * kSide / 2.0, 0.0}};
}

std::vector<PaperStep> simulate_example_4_2(Method method) {
  const Scene scene = paper_scene(1.0);
  const Inertia& M = scene.tool().solid.inertia;
  PenetrationDepth depth(scene, {method});
  WrenchLaw law(gains_for(method, paper_gains()));
  Pose X_WP{rotation_from({0.0, 0.0, std::atan2(0.7954, 0.6061)}), {0.0, 34.1817, 0.0}};  // Eq. (52)
  Twist V{{0.0, -5.0, 0.0}, {0.0, 0.0, 0.2}};                                             // Eq. (54)

  std::vector<PaperStep> steps;
  Pose X_WQ = X_WP;
  for (int i = 0; i < kSteps; ++i) {
    const Penetration p = i == 0 ? depth.query(X_WP) : depth.follow(X_WP, X_WQ);
    X_WQ = p.projection.X_WQ;
    const bool in_contact = p.contacts > 0;
    const Wrench F_T = law.update(p.spring_displacement, in_contact, kStep_s);
    steps.push_back({i * kStep_s, X_WP, in_contact, expressed(X_WP.rotation, F_T)});
    move(M, F_T, V, X_WP);
  }
  return steps;
}

PaperSummary summary_of(const std::vector<PaperStep>& steps) {
  PaperSummary summary;
  for (const PaperStep& step : steps) {
    summary.steps_in_contact += step.in_contact ? 1 : 0;
    summary.max_force_y = std::max(summary.max_force_y, step.F_W.force_N.y());
    summary.max_torque_z = std::max(summary.max_torque_z, std::abs(step.F_W.torque_Nm.z()));
  }
  return summary;
}

}  // namespace wrenchd
