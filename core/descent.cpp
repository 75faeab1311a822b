// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/descent.hpp"

#include <algorithm>
#include <cmath>

namespace wrenchd {
namespace {

constexpr int kIterations = 200;
constexpr int kMaxHalvings = 30;
/// Convergence: gradient norm relative to that of the first iterate. A smaller value changes only the last
/// digits of T.
constexpr double kConverged = 1e-6;
/// Armijo constant, usual value.
constexpr double kArmijo = 1e-4;

bool admissible(const Projection& projection) noexcept {
  return projection.status != ProjectionStatus::infeasible;
}

}  // namespace

Vector3d Descent::gradient(const Pose& X_WP, const Projection& at) const noexcept {
  Quaterniond E = X_WP.rotation.conjugate() * at.X_WQ.rotation;
  if (E.w() < 0.0) E.coeffs() *= -1.0;
  const Vector3d Hv = M_.H_kg_m2 * E.vec();
  Vector3d g = 4.0 * (E.w() * Hv - E.vec().cross(Hv));
  for (const auto& [contact, multiplier] : evenly_loaded_contacts(at)) {
    const Vector3d lever_W = contact_point_W(contact, at.X_WQ) - at.X_WQ.translation_m;
    g -= multiplier * (at.X_WQ.rotation.conjugate() * lever_W.cross(normal_W(contact, at.X_WQ)));
  }
  return g;
}

// Polak-Ribiere directions, METHOD (58), conjugate in the metric of H, in which all rotation axes have equal
// weight. A direction that does not descend is replaced by the negative gradient.
Projection Descent::project(const Pose& X_WP, const ContactSource& scene, const Pose& X_start) noexcept {
  const Matrix3d H_inverse = M_.H_kg_m2.inverse();
  Projection best = translations_.translate(X_WP, scene, X_start);
  if (!admissible(best) || best.status == ProjectionStatus::free) return best;

  Vector3d g = gradient(X_WP, best);
  const double tolerance = kConverged * std::sqrt(g.dot(H_inverse * g));
  Vector3d direction = -(H_inverse * g);
  double step = 0.25;  // in units of a Newton step on 2 H, the Hessian of T without contacts
  best.status = ProjectionStatus::budget_spent;
  for (int i = 0; i < kIterations; ++i) {
    if (std::sqrt(g.dot(H_inverse * g)) <= tolerance) {
      best.status = ProjectionStatus::converged;
      return best;
    }
    double slope = g.dot(direction);
    if (!(slope < 0.0)) {
      direction = -(H_inverse * g);
      slope = g.dot(direction);
    }
    step = std::min(2.0 * step, 1.0 / std::max(direction.norm(), 1e-300));  // at most 1 rad
    Projection trial;
    bool decreased = false;
    for (int halving = 0; halving < kMaxHalvings && !decreased; ++halving) {
      const Pose X_trial{best.X_WQ.rotation * rotation_from(step * direction), best.X_WQ.translation_m};
      trial = translations_.translate(X_WP, scene, X_trial);
      decreased = admissible(trial) && trial.energy < best.energy + kArmijo * step * slope;
      if (!decreased) step *= 0.5;
    }
    if (!decreased) return best;
    const Vector3d g_new = gradient(X_WP, trial);
    const double beta = std::max(0.0, g_new.dot(H_inverse * (g_new - g)) / g.dot(H_inverse * g));
    direction = beta * direction - H_inverse * g_new;
    g = g_new;
    best = trial;
    best.status = ProjectionStatus::budget_spent;
    best.iterations = static_cast<std::uint16_t>(i + 1);
  }
  return best;
}

}  // namespace wrenchd
