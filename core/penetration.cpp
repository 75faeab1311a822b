// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/penetration.hpp"

#include <limits>
#include <span>

namespace wrenchd {
namespace {

bool in_contact(const Projection& projection) noexcept {
  return projection.status == ProjectionStatus::converged ||
         projection.status == ProjectionStatus::budget_spent;
}

Vector6d displacement(const Pose& X_WP, const Pose& X_WQ) noexcept {
  return log(inverse(X_WP) * X_WQ);
}

}  // namespace

PenetrationDepth::PenetrationDepth(const Inertia& M, const ConvexBody& body, Options options)
    : options_(options), mass_kg_(M.mass_kg), exact_(M), planar_(M, body, options.planes) {}

Penetration PenetrationDepth::follow(const Pose& X_WP, const ContactSource& scene,
                                     const Pose& X_last) noexcept {
  if (options_.method != Method::exact) return query(X_WP, scene);
  Penetration out = described(X_WP, exact_.project(X_WP, scene, X_last));
  if (out.projection.status != ProjectionStatus::infeasible) return out;
  out.projection.X_WQ = X_last;
  out.eps = displacement(X_WP, X_last);
  out.drive = out.eps;
  out.contacts = 1;
  return out;
}

Penetration PenetrationDepth::query(const Pose& X_WP, const ContactSource& scene) noexcept {
  switch (options_.method) {
    case Method::planar:
      return planar(X_WP, scene);
    case Method::translational:
      return translational(X_WP, scene);
    case Method::exact:
      break;
  }
  return described(X_WP, exact_.project_globally(X_WP, scene));
}

/// What every method says of its answer.
Penetration PenetrationDepth::described(const Pose& X_WP, const Projection& projection) noexcept {
  Penetration out;
  out.projection = projection;
  if (!in_contact(projection)) return out;
  out.contacts = projection.active_count;
  out.eps = displacement(X_WP, projection.X_WQ);
  out.drive = out.eps;
  return out;
}

/// Every contact on its own, in every plane of its family. Generically one vertex collides, and its
/// projection frees the whole body: the best that does is the answer. Where none does (the family looks at
/// one cross-section, and a vertex beside it stays inside), the wrenches of the contacts are added, as
/// section 5 of the paper says, and the pose reported is the best of their rotations lifted until the whole
/// body is out. Translation alone always is a candidate.
Penetration PenetrationDepth::planar(const Pose& X_WP, const ContactSource& scene) noexcept {
  Penetration out = described(X_WP, exact_.translate(X_WP, scene, X_WP));
  if (out.projection.status == ProjectionStatus::free) return out;
  contacts_.clear();
  while (scene.add_violated(X_WP, 0.0, contacts_) > 0) continue;

  bool freed = false;
  Pose X_WQ = out.projection.X_WQ;
  double T = in_contact(out.projection) ? out.projection.energy : std::numeric_limits<double>::infinity();
  Vector6d sum = Vector6d::Zero();
  for (const Contact& contact : contacts_) {
    const PlanarFamily::AtContact family = planar_.at(X_WP, contact);
    PlanarFamily::InPlane best = family.solve(0);
    for (int k = 0; k < planar_.planes(); ++k) {
      const PlanarFamily::InPlane one = family.solve(k);
      if (one.minimum.T < best.minimum.T) best = one;
      if (one.minimum.T >= T) continue;
      const Pose candidate = PlanarFamily::pose(X_WP, contact, one);
      probe_.clear();
      if (scene.add_violated(candidate, exact_.gap_tolerance_m(candidate), probe_) > 0) continue;
      freed = true;
      X_WQ = candidate;
      T = one.minimum.T;
    }
    const Pose alone = PlanarFamily::pose(X_WP, contact, best);
    sum += displacement(X_WP, alone);
    if (freed) continue;
    const Projection lifted = exact_.translate(X_WP, scene, alone);
    if (!in_contact(lifted) || lifted.energy >= T) continue;
    X_WQ = lifted.X_WQ;
    T = lifted.energy;
  }
  out = described(X_WP,
                  exact_.translate(X_WP, scene, X_WQ));  // fills in the contacts; moves q by rounding only
  out.drive = freed ? out.eps : sum;
  return out;
}

/// The depth of each obstacle acts at the mean of the tool's vertices that touch it: an edge or a face that
/// lies flat has no single deepest vertex, and choosing one would make a torque out of rounding.
Penetration PenetrationDepth::translational(const Pose& X_WP, const ContactSource& scene) noexcept {
  Penetration out = described(X_WP, exact_.translate(X_WP, scene, X_WP));
  if (!in_contact(out.projection)) return out;
  const auto active = std::span(out.projection.active).first(out.projection.active_count);
  Vector3d moment = Vector3d::Zero();
  for (const ActiveContact& a : active) {
    double touching = 0.0;
    double carried = 0.0;
    for (const ActiveContact& b : active) {
      if (b.contact.obstacle != a.contact.obstacle) continue;
      touching += 1.0;
      carried += b.multiplier;
    }
    const Vector3d n_T = X_WP.rotation.conjugate() * a.contact.n_W;
    moment += a.contact.p_TA_m.cross(n_T) * (carried / touching);
  }
  // 2 m s = sum multiplier_i n_i: contact i carries the displacement multiplier_i n_i / (2 m).
  out.drive.tail<3>() = moment / (2.0 * mass_kg_);
  return out;
}

}  // namespace wrenchd
