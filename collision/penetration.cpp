// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/penetration.hpp"

#include <algorithm>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>

#include "core/metric.hpp"

namespace wrenchd {
namespace {

/// An answer is better where its energy is less by more than rounding.
constexpr double kBetter = 1.0 - 1e-10;

bool in_contact(const Projection& projection) noexcept {
  return projection.status == ProjectionStatus::converged ||
         projection.status == ProjectionStatus::budget_spent;
}

Vector6d displacement(const Pose& X_WP, const Pose& X_WQ) noexcept {
  return log(inverse(X_WP) * X_WQ);
}

/// Of a scene of meshes that are not held as convex bodies as well.
std::string why_only_exact(const Scene& scene) {
  for (const MeshObstacle& obstacle : scene.meshes())
    if (obstacle.moves())
      return "the obstacle '" + obstacle.name +
             "' moves, which only method exact can deal with; choose it, or let all obstacles stand still";
  return "the tool or an obstacle ('" + scene.meshes().front().name +
         "', ...) is not convex, which only method exact can deal with; choose it, or give convex bodies";
}

}  // namespace

PenetrationDepth::PenetrationDepth(const Scene& scene, Options options)
    : options_(options),
      bodies_(scene),
      M_(scene.tool().solid.inertia),
      scene_contacts_(scene),
      exact_(scene.tool().solid.inertia, ExactProjection::Budget{}, options.clearance_m),
      descent_(scene.tool().solid.inertia, exact_),
      planar_(scene.tool().solid.inertia, scene.tool().hull, options.planes),
      saved_planes_(scene.convex().size()),
      best_planes_(scene.convex().size()) {
  if (options.friction.enabled()) {
    if (options.method != Method::exact)
      throw std::invalid_argument(
          "only method exact knows friction; choose it, or leave friction out ([rendering.friction], "
          "--friction)");
    friction_.emplace(scene.tool().solid.inertia, options.friction,
                      scene.meshes().empty() ? options.clearance_m : Proxy::kClearance_m);
  }
  if (scene.meshes().empty()) return;
  const bool convex = !scene.convex().empty();
  if (options.method != Method::exact && !convex) throw std::invalid_argument(why_only_exact(scene));
  if (options.method == Method::exact) proxy_.emplace(scene);
  if (!convex) pose_search_.emplace(scene);
}

Penetration PenetrationDepth::follow(const Pose& X_WP, const Pose& X_last, double scene_time_s) noexcept {
  return friction_ ? follow_with_friction(X_WP, X_last, scene_time_s)
                   : follow_frictionless(X_WP, X_last, scene_time_s);
}

/// What friction does to p comes first. A tool that it holds altogether has nothing to look for, unless what
/// it stands on moves.
Penetration PenetrationDepth::follow_with_friction(const Pose& X_WP, const Pose& X_last,
                                                   double scene_time_s) noexcept {
  const bool moves = proxy_ && bodies_.has_moving_obstacles();
  Pose X_held = X_last;
  if (moves)
    X_held = friction_->carry_with_obstacle(X_last, [&](std::uint32_t obstacle) {
      return bodies_.obstacle_displacement(obstacle, proxy_->admissible_time_s(), scene_time_s);
    });
  const Pose X_felt = friction_->frictional_goal(X_WP, X_held, !moves);
  Penetration out;
  if (friction_->sticks()) {
    if (proxy_) proxy_->hold(X_last);
    out = to_penetration(X_WP, friction_->stuck_projection());
  } else {
    out = follow_frictionless(X_felt, X_last, scene_time_s);
    if (!same_bits(X_felt, X_WP)) {
      Projection& q = out.projection;
      // Off the edge of what it rubbed on: on its way to p, where it comes to at the next tick.
      if (q.status == ProjectionStatus::free) q.status = ProjectionStatus::budget_spent;
      q.energy = energy(M_, X_WP, q.X_WQ);
      out.contacts = std::max<std::uint16_t>(out.contacts, 1);
      out.eps = displacement(X_WP, q.X_WQ);
      out.spring_displacement = out.eps;
    }
  }
  friction_->store_contacts(out.projection);
  return out;
}

Penetration PenetrationDepth::follow_frictionless(const Pose& X_WP, const Pose& X_last,
                                                  double scene_time_s) noexcept {
  if (proxy_) return to_penetration(X_WP, proxy_->follow(X_WP, X_last, scene_time_s));
  const bool admitted = X_last_answer_ && same_bits(*X_last_answer_, X_last);
  if (!admitted) scene_contacts_.select_admitting_planes(X_last, exact_.gap_tolerance_m(X_last));
  Penetration out =
      options_.method == Method::exact ? follow_exactly(X_WP, X_last) : approximate(X_WP, X_last);
  X_last_answer_.reset();
  if (out.projection.status != ProjectionStatus::infeasible) X_last_answer_ = out.projection.X_WQ;
  return out;
}

Penetration PenetrationDepth::follow_exactly(const Pose& X_WP, const Pose& X_last) noexcept {
  const auto solve = [&](const Pose& X_start) { return exact_.project(X_WP, scene_contacts_, X_start); };
  const std::span known(warm_start_.begin(), warm_start_.end());
  Projection q = exact_.project(X_WP, scene_contacts_, X_last, known);
  refine_planes(q, solve);
  Penetration out = to_penetration(X_WP, q);
  warm_start_.clear();
  for (const ActiveContact& active : out.projection.active)
    if (active.multiplier > 0.0) warm_start_.add(active);
  if (out.projection.status != ProjectionStatus::infeasible) return out;
  out.projection.X_WQ = X_last;
  out.eps = displacement(X_WP, X_last);
  out.spring_displacement = out.eps;
  out.contacts = 1;
  return out;
}

void PenetrationDepth::clear_history(double scene_time_s) noexcept {
  warm_start_.clear();
  X_last_answer_.reset();
  if (friction_) friction_->reset();
  if (proxy_) proxy_->clear_history(scene_time_s);
}

Penetration PenetrationDepth::query(const Pose& X_WP, const std::stop_token& stop,
                                    double scene_time_s) noexcept {
  clear_history(scene_time_s);
  if (pose_search_) return to_penetration(X_WP, pose_search_->nearest(X_WP, stop, scene_time_s));
  if (options_.method == Method::exact) return to_penetration(X_WP, project_globally(X_WP, stop));
  scene_contacts_.survey_planes(X_WP);
  return approximate(X_WP, X_WP);
}

/// What the paper has: none of it seeks the global optimum.
Penetration PenetrationDepth::approximate(const Pose& X_WP, const Pose& X_start) noexcept {
  if (options_.method == Method::descent) return descend(X_WP, X_start);
  return options_.method == Method::planar ? planar(X_WP) : translational(X_WP);
}

Penetration PenetrationDepth::descend(const Pose& X_WP, const Pose& X_start) noexcept {
  const auto solve = [&](const Pose& X_from) { return descent_.project(X_WP, scene_contacts_, X_from); };
  Projection q = solve(X_start);
  refine_planes(q, solve);
  return to_penetration(X_WP, q);
}

/// Changes the planes held until no other plane that admits the best answer gives a better one, which takes
/// its place. solve: the answer for the planes held, sought from a pose.
template <class Solve>
void PenetrationDepth::refine_planes(Projection& best, const Solve& solve) noexcept {
  constexpr int kChanges = 12;        // typical: none or one
  constexpr std::size_t kTries = 16;  // of the planes that touch, the widest apart first
  for (int change = 0; change < kChanges; ++change) {
    if (!in_contact(best) || scene_contacts_.planes_optimal(best)) return;
    const std::size_t choices = std::min(kTries, scene_contacts_.find_alternative_planes(best.X_WQ));
    bool improved = false;
    saved_planes_ = scene_contacts_.planes();
    for (std::size_t i = 0; i < choices && !improved; ++i) {
      scene_contacts_.hold_alternative(i);
      const Projection other = solve(best.X_WQ);
      improved = other.status != ProjectionStatus::infeasible && other.energy < kBetter * best.energy;
      if (improved)
        best = other;
      else
        scene_contacts_.set_planes(saved_planes_);
    }
    if (!improved) return;
  }
}

/// The best answer from every plane worth a try, one obstacle at a time: from the rotation of p, then from
/// that of the best answer so far, until a round finds nothing better. Half-spaces leave no choice.
Projection PenetrationDepth::project_globally(const Pose& X_WP, const std::stop_token& stop) noexcept {
  const std::size_t openings = scene_contacts_.survey_planes(X_WP);
  if (openings == 0) return exact_.project_globally(X_WP, scene_contacts_);
  const auto solve = [&](const Pose& X_start) { return exact_.project(X_WP, scene_contacts_, X_start); };
  Projection best = solve(X_WP);
  refine_planes(best, solve);
  best_planes_ = scene_contacts_.planes();
  const auto try_all_from = [&](const Pose& X_start) {
    bool improved = false;
    for (std::size_t i = 0; i < openings && best.status != ProjectionStatus::free; ++i) {
      if (stop.stop_requested()) return false;
      scene_contacts_.hold_survey_plane(i);
      Projection other = solve(X_start);
      refine_planes(other, solve);
      if (other.status == ProjectionStatus::infeasible) continue;
      if (best.status != ProjectionStatus::infeasible && !(other.energy < kBetter * best.energy)) continue;
      best = other;
      best_planes_ = scene_contacts_.planes();
      improved = true;
    }
    return improved;
  };
  constexpr int kRounds = 4;
  try_all_from(X_WP);
  for (int round = 0; round < kRounds && in_contact(best); ++round)
    if (!try_all_from(Pose(best.X_WQ))) break;
  scene_contacts_.set_planes(best_planes_);
  return best;
}

/// The nearest translation, over the planes that touch.
Projection PenetrationDepth::translate(const Pose& X_WP) noexcept {
  const auto solve = [&](const Pose&) { return exact_.translate(X_WP, scene_contacts_, X_WP); };
  Projection q = solve(X_WP);
  refine_planes(q, solve);
  return q;
}

/// What every method says of its answer.
Penetration PenetrationDepth::to_penetration(const Pose& X_WP, const Projection& projection) noexcept {
  Penetration out;
  out.projection = projection;
  if (!in_contact(projection)) return out;
  // A proxy that ran out of time may stand on its way, held by nothing but that.
  out.contacts = static_cast<std::uint16_t>(std::max<std::size_t>(projection.active.size(), 1));
  out.eps = displacement(X_WP, projection.X_WQ);
  out.spring_displacement = out.eps;
  return out;
}

/// Every contact on its own, in every plane of its family; a convex obstacle counts as the half-space of the
/// plane held, which for two edges is that of their common normal. Generically one vertex collides, and its
/// projection frees the whole body: the best that does is the answer. Where none does (the family looks at
/// one cross-section, and a vertex beside it stays inside), the wrenches of the contacts are added, as
/// section 5 of the paper says, and the pose reported is the best of their rotations lifted until the whole
/// body is out. Translation alone always is a candidate.
Penetration PenetrationDepth::planar(const Pose& X_WP) noexcept {
  Penetration out = to_penetration(X_WP, translate(X_WP));
  if (out.projection.status == ProjectionStatus::free) return out;
  scene_contacts_.fix_planes_to_world(X_WP);
  contacts_.clear();
  while (scene_contacts_.add_violated(X_WP, 0.0, contacts_) > 0) continue;

  bool freed = false;
  Pose X_WQ = out.projection.X_WQ;
  double T = in_contact(out.projection) ? out.projection.energy : std::numeric_limits<double>::infinity();
  Vector6d sum = Vector6d::Zero();
  for (const Contact& contact : contacts_) {
    const auto family = planar_.at(X_WP, contact);
    PlanarFamily::InPlane best = family.solve(0);
    for (int k = 0; k < planar_.planes(); ++k) {
      const PlanarFamily::InPlane one = family.solve(k);
      if (one.minimum.T < best.minimum.T) best = one;
      if (one.minimum.T >= T) continue;
      const Pose candidate = PlanarFamily::pose(X_WP, contact, one);
      if (!scene_contacts_.admits(candidate, exact_.gap_tolerance_m(candidate))) continue;
      freed = true;
      X_WQ = candidate;
      T = one.minimum.T;
    }
    const Pose alone = PlanarFamily::pose(X_WP, contact, best);
    sum += displacement(X_WP, alone);
    if (freed) continue;
    const Projection lifted = exact_.translate(X_WP, scene_contacts_, alone);
    if (!in_contact(lifted) || lifted.energy >= T) continue;
    X_WQ = lifted.X_WQ;
    T = lifted.energy;
  }
  const auto lift = [&](const Pose&) { return exact_.translate(X_WP, scene_contacts_, X_WQ); };
  Projection q = lift(X_WQ);
  refine_planes(q, lift);  // lets q down onto what it stands clear of
  out = to_penetration(X_WP, q);
  out.spring_displacement = freed ? out.eps : sum;
  return out;
}

/// The depth of each obstacle acts at the mean of the contacts that touch it.
Penetration PenetrationDepth::translational(const Pose& X_WP) noexcept {
  Penetration out = to_penetration(X_WP, translate(X_WP));
  if (!in_contact(out.projection)) return out;
  const Pose& X_WQ = out.projection.X_WQ;
  Vector3d moment = Vector3d::Zero();
  for (const auto& [contact, multiplier] : evenly_loaded_contacts(out.projection)) {
    const Vector3d lever_W = contact_point_W(contact, X_WQ) - X_WQ.translation_m;
    moment += multiplier * (X_WP.rotation.conjugate() * lever_W.cross(normal_W(contact, X_WQ)));
  }
  // 2 m s = sum multiplier_i n_i: contact i carries the displacement multiplier_i n_i / (2 m).
  out.spring_displacement.tail<3>() = moment / (2.0 * M_.mass_kg);
  return out;
}

}  // namespace wrenchd
