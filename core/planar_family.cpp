// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/planar_family.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/quartic.hpp"

namespace wrenchd {
namespace {

/// Eq. (20) with the vertex on the plane:  beta = -vx sin(theta) - vy cos(theta).
PlanarMinimum at(const PlanarSection& s, double theta) noexcept {
  const double beta = -s.vx * std::sin(theta) - s.vy * std::cos(theta);
  const double half = std::sin(0.5 * theta);
  return {theta, beta, s.m * (beta - s.h) * (beta - s.h) + 4.0 * s.H * half * half};  // Eq. (18), phi = 0
}

/// Two directions that span the obstacle plane: Z, and X = n x Z, so that (X, n, Z) is right-handed.
struct PlaneAxes {
  Vector3d X;
  Vector3d Z;
};

PlaneAxes axes_of(const Vector3d& n) noexcept {
  const Vector3d along = std::abs(n.z()) < 0.9 ? Vector3d::UnitZ() : Vector3d::UnitX();
  const Vector3d Z = (along - along.dot(n) * n).normalized();
  return {n.cross(Z), Z};
}

}  // namespace

// Stationary angles solve the quartic (25) in x = tan(theta/2), Eq. (24), with the coefficients (26)-(30) at
// phi = 0. Where A_1 vanishes a root has gone to x = infinity: theta = pi, which is tried as well.
PlanarMinimum minimise(const PlanarSection& s) noexcept {
  const double A1 = s.m * s.vx * s.vy - s.m * s.vx * s.h;
  const double B1 = 2.0 * (s.H - s.m * s.h * s.vy - s.m * s.vx * s.vx + s.m * s.vy * s.vy);
  const double C1 = -6.0 * s.m * s.vx * s.vy;
  const double D1 = 2.0 * (s.H - s.m * s.h * s.vy + s.m * s.vx * s.vx - s.m * s.vy * s.vy);
  const double E1 = s.m * s.vx * s.vy + s.m * s.vx * s.h;

  PlanarMinimum best = at(s, s.theta_min);  // the border values of Eqs. (31), (32)
  const auto try_angle = [&](double theta) {
    if (theta < s.theta_min || theta > s.theta_max) return;
    const PlanarMinimum candidate = at(s, theta);
    if (candidate.T < best.T) best = candidate;
  };
  try_angle(s.theta_max);
  try_angle(std::numbers::pi);
  try_angle(-std::numbers::pi);
  for (const double x : real_roots(A1, B1, C1, D1, E1)) {
    const double theta = 2.0 * std::atan(x);
    try_angle(theta);
    try_angle(theta + 2.0 * std::numbers::pi);  // an edge below the obstacle at p puts theta_max beyond pi
  }
  return best;
}

/// The faces around a vertex: its neighbours relative to it, in world axes at p.
struct PlanarFamily::Star {
  const ConvexBody& body;
  std::span<const std::uint32_t> ring;
  Quaterniond R_WP;
  Vector3d apex_T;

  Vector3d edge(std::size_t i) const noexcept { return R_WP * (body.vertices_T_m[ring[i]] - apex_T); }
};

PlanarFamily::PlanarFamily(const Inertia& M, const ConvexBody& body, int planes)
    : M_(M), body_(body), planes_(std::max(planes, 1)) {}

/// Algorithm 2 for any star: the plane with normal w cuts the faces around the vertex in two directions;
/// between them lies the body. A face edge in the plane is its own direction. Where the plane meets the body
/// in the vertex only, nothing limits the angle.
///
/// With the bisector at angle mid from e1 and the inner angle gamma (line 20), both directions stay above the
/// obstacle for   -mid + gamma/2 <= theta <= pi - mid - gamma/2,   which is Eq. (21) when one lies on it at
/// 0.
PlanarSection PlanarFamily::limited(PlanarSection section, const Vector3d& e1, const Vector3d& n,
                                    const Vector3d& w, const Star& star) noexcept {
  section.theta_min = -std::numbers::pi;
  section.theta_max = std::numbers::pi;
  Vector3d cut[2];
  int cuts = 0;
  Vector3d previous = star.edge(star.ring.size() - 1);
  double d_previous = w.dot(previous);
  for (std::size_t i = 0; i < star.ring.size() && cuts < 2; ++i) {
    const Vector3d edge = star.edge(i);
    const double d = w.dot(edge);
    if (d == 0.0) {
      cut[cuts++] = edge;  // lines 1-8: the plane passes through an edge
    } else if (d * d_previous < 0.0) {
      cut[cuts++] = previous + (d_previous / (d_previous - d)) * (edge - previous);  // lines 10-15
    }
    previous = edge;
    d_previous = d;
  }
  if (cuts < 2) return section;
  const Vector3d a = cut[0].normalized();
  const Vector3d b = cut[1].normalized();
  const Vector3d bisector = a + b;
  const double mid = std::atan2(n.dot(bisector), e1.dot(bisector));
  const double gamma = 2.0 * std::atan2((a - b).norm(), bisector.norm());
  section.theta_min = -mid + 0.5 * gamma;
  section.theta_max = std::numbers::pi - mid - 0.5 * gamma;
  return section;
}

PlanarFamily::InPlane PlanarFamily::solve(const Pose& X_WP, const Contact& contact, int k) const noexcept {
  const Vector3d& n = contact.n_W;
  const auto [X, Z] = axes_of(n);
  const double delta = std::numbers::pi * k / planes_;
  const Vector3d w = std::sin(delta) * X + std::cos(delta) * Z;  // the axis w_delta; (34) as sine and cosine
  const Vector3d e1 = n.cross(w);
  const Vector3d v = X_WP.rotation * contact.p_TA_m;
  const Vector3d w_T = X_WP.rotation.conjugate() * w;
  PlanarSection section;
  section.m = M_.mass_kg;
  section.H = w_T.dot(M_.H_kg_m2 * w_T);
  section.vx = e1.dot(v);
  section.vy = n.dot(v);
  section.h = n.dot(X_WP.translation_m) - contact.offset_m;
  const Star star{body_, body_.ring_of(contact.vertex), X_WP.rotation, contact.p_TA_m};
  return {minimise(limited(section, e1, n, w, star)), w};
}

Pose PlanarFamily::pose(const Pose& X_WP, const Contact& contact, const InPlane& solution) noexcept {
  const double h = contact.n_W.dot(X_WP.translation_m) - contact.offset_m;
  const Quaterniond turn(Eigen::AngleAxisd(solution.minimum.theta, solution.axis_W));
  return {(turn * X_WP.rotation).normalized(),
          X_WP.translation_m + (solution.minimum.beta - h) * contact.n_W};
}

}  // namespace wrenchd
