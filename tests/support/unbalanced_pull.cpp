// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/unbalanced_pull.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace wrenchd::test {
namespace {

/// Returns the distance of a point from a triangle [m].
double distance_m(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const auto from_side = [&](const Vector3d& from, const Vector3d& to) {
    const Vector3d along = to - from;
    const double share = std::clamp((p - from).dot(along) / along.squaredNorm(), 0.0, 1.0);
    return (p - from - share * along).norm();
  };
  const Vector3d n = (b - a).cross(c - a);
  const bool above = n.cross(b - a).dot(p - a) >= 0.0 && n.cross(c - b).dot(p - b) >= 0.0 &&
                     n.cross(a - c).dot(p - c) >= 0.0;
  if (above) return std::abs(n.dot(p - a)) / n.norm();
  return std::min({from_side(a, b), from_side(b, c), from_side(c, a)});
}

double distance_m(const Vector3d& p, const MeshSurface& surface) {
  double least_m = std::numeric_limits<double>::infinity();
  for (std::uint32_t t = 0; t < surface.triangles().size(); ++t)
    least_m = std::min(least_m,
                       distance_m(p, surface.corner_m(t, 0), surface.corner_m(t, 1), surface.corner_m(t, 2)));
  return least_m;
}

}  // namespace

double unbalanced_pull(const Scene& scene, const Pose& X_WP, const Projection& q) {
  constexpr double kClosed_m = 3e-9, kOnSurface_m = 1e-8, kLeastPull = 1e-6;
  const Inertia& M = scene.tool().solid.inertia;
  const double L_m = std::sqrt(M.H_kg_m2.trace() / (2.0 * M.mass_kg));
  const Matrix3d H = M.H_kg_m2 / (M.mass_kg * L_m * L_m);
  const Matrix3d R_PW = X_WP.rotation.conjugate().toRotationMatrix();
  const Matrix3d R_QW = q.X_WQ.rotation.conjugate().toRotationMatrix();
  Quaterniond E = (X_WP.rotation.conjugate() * q.X_WQ.rotation).normalized();
  if (E.w() < 0.0) E.coeffs() *= -1.0;
  const Vector3d Hv = H * E.vec();
  Vector6d pull;
  pull << 2.0 * R_PW * (q.X_WQ.translation_m - X_WP.translation_m) / L_m,
      4.0 * (E.w() * Hv - E.vec().cross(Hv));
  Vector6d rest = pull;
  for (const ActiveContact& active : q.active) {
    if (!(active.multiplier > 0.0) || gap_m(active.contact, q.X_WQ) > kClosed_m) continue;
    const Vector3d p_W = contact_point_W(active.contact, q.X_WQ), n_W = normal_W(active.contact, q.X_WQ);
    const std::uint32_t obstacle = active.contact.obstacle;
    if (obstacle >= scene.first_mesh()) {
      const MeshObstacle& mesh = scene.meshes()[obstacle - scene.first_mesh()];
      if (distance_m(inverse(mesh.X_WO) * p_W, mesh.mesh->surface) > kOnSurface_m ||
          distance_m(inverse(q.X_WQ) * p_W, scene.tool_mesh()->surface) > kOnSurface_m)
        continue;
    }
    Vector6d J;
    J << R_PW * n_W, R_QW * (p_W - q.X_WQ.translation_m).cross(n_W) / L_m;
    rest -= active.multiplier / (M.mass_kg * L_m) * J;
  }
  return rest.norm() / std::max(pull.norm(), kLeastPull);
}

}  // namespace wrenchd::test
