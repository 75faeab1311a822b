// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/penetration.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>

#include "core/metric.hpp"

namespace wrenchd {
namespace {

/// An answer is better if its energy is lower by more than rounding.
constexpr double kImprovement = 1.0 - 1e-10;

bool in_contact(const Projection& projection) noexcept {
  return projection.status == ProjectionStatus::converged ||
         projection.status == ProjectionStatus::budget_spent;
}

Vector6d displacement(const Pose& X_WP, const Pose& X_WQ) noexcept {
  return log(inverse(X_WP) * X_WQ);
}

/// Which planes the global search among convex bodies tries, by energies as multiples of the best one so far.
/// The margins are fitted, not proven: at 1,068 poses of 10 random pairs of 8 to 642 vertices the search
/// found the same answers as without margins. They fall with the number of vertices, because the finer the
/// bodies are, the more planes are nearly equal, and the less an exchange of planes improves an answer.
struct SearchMargins {
  double estimate;      ///< largest SceneContacts::survey_estimate() of a plane that is tried
  double first_answer;  ///< largest T of an answer that is improved by exchanging planes
  double again = 1.05;  ///< largest T of a first answer whose plane is tried again from the best rotation

  explicit SearchMargins(const Scene& scene) noexcept {
    std::size_t fewest = std::numeric_limits<std::size_t>::max();
    for (const ConvexObstacle& obstacle : scene.convex())
      fewest = std::min(fewest, obstacle.body.vertices_T_m.size());
    const auto vertices = static_cast<double>(scene.tool().hull.vertices_T_m.size() + fewest);
    estimate = 1.5 + 10.0 / std::sqrt(vertices);
    first_answer = 1.0 + 4.0 / std::sqrt(vertices);
  }
};

/// For a scene of meshes whose bodies are not all convex and at rest.
std::string only_exact_reason(const Scene& scene) {
  for (const MeshObstacle& obstacle : scene.meshes())
    if (obstacle.moves())
      return "the obstacle '" + obstacle.name +
             "' moves, and only method exact supports moving obstacles; choose it, or keep all obstacles at "
             "rest";
  return "the tool or an obstacle ('" + scene.meshes().front().name +
         "', ...) is not convex, and only method exact supports that; choose it, or use convex bodies";
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
      best_planes_(scene.convex().size()),
      first_energies_(SceneContacts::kMaxSurveyPlanes) {
  if (options.friction.enabled()) {
    if (options.method != Method::exact)
      throw std::invalid_argument(
          "only method exact supports friction; choose it, or remove friction ([rendering.friction], "
          "--friction)");
    friction_.emplace(scene.tool().solid.inertia, options.friction,
                      scene.meshes().empty() ? options.clearance_m : Proxy::kClearance_m);
  }
  if (options.contacts == ContactBackend::cgal && options.method != Method::exact)
    throw std::invalid_argument(
        "only method exact detects contacts with CGAL; choose it, or remove [rendering] contacts "
        "(--contacts)");
  if (scene.meshes().empty()) return;
  const bool convex = !scene.convex().empty();
  if (options.method != Method::exact && !convex) throw std::invalid_argument(only_exact_reason(scene));
  if (options.method == Method::exact) proxy_.emplace(scene, options.work_limit, options.contacts);
  if (!convex) pose_search_.emplace(scene, options.contacts);
}

Penetration PenetrationDepth::follow(const Pose& X_WP, const Pose& X_last, double scene_time_s) noexcept {
  return friction_ ? follow_with_friction(X_WP, X_last, scene_time_s)
                   : follow_frictionless(X_WP, X_last, scene_time_s);
}

/// Friction modifies p first. If the tool sticks, there is nothing to solve, unless its support moves.
Penetration PenetrationDepth::follow_with_friction(const Pose& X_WP, const Pose& X_last,
                                                   double scene_time_s) noexcept {
  const bool moves = proxy_ && bodies_.has_moving_obstacles();
  Pose X_carried = X_last;
  if (moves)
    X_carried = friction_->carry_with_obstacle(X_last, [&](std::uint32_t obstacle) {
      return bodies_.obstacle_displacement(obstacle, proxy_->admissible_time_s(), scene_time_s);
    });
  const Pose X_felt = friction_->frictional_goal(X_WP, X_carried, !moves);
  Penetration out;
  if (friction_->sticks()) {
    if (proxy_) proxy_->hold(X_last);
    out = to_penetration(X_WP, friction_->stuck_projection());
  } else {
    out = follow_frictionless(X_felt, X_last, scene_time_s);
    if (!same_bits(X_felt, X_WP)) {
      Projection& q = out.projection;
      // The tool has moved past the edge of the surface. It reaches p in the next tick.
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

void PenetrationDepth::discard_contacts() noexcept {
  warm_start_.clear();
  X_last_answer_.reset();
  if (proxy_) proxy_->discard_contacts();
}

Penetration PenetrationDepth::query(const Pose& X_WP, const std::stop_token& stop,
                                    double scene_time_s) noexcept {
  clear_history(scene_time_s);
  if (pose_search_) return to_penetration(X_WP, pose_search_->nearest(X_WP, stop, scene_time_s));
  if (options_.method == Method::exact) return to_penetration(X_WP, project_globally(X_WP, stop));
  scene_contacts_.survey_planes(X_WP);
  return approximate(X_WP, X_WP);
}

/// The methods of the paper do not search the optimum. The residual tells how far from it the answer is.
Penetration PenetrationDepth::approximate(const Pose& X_WP, const Pose& X_start) noexcept {
  Penetration out = options_.method == Method::descent  ? descend(X_WP, X_start)
                    : options_.method == Method::planar ? planar(X_WP)
                                                        : translational(X_WP);
  if (!in_contact(out.projection)) return out;
  Projection at_q = out.projection;  // keeps the multipliers of the method
  exact_.balance(X_WP, at_q);
  out.projection.kkt_residual = at_q.kkt_residual;
  return out;
}

Penetration PenetrationDepth::descend(const Pose& X_WP, const Pose& X_start) noexcept {
  const auto solve = [&](const Pose& X_from) { return descent_.project(X_WP, scene_contacts_, X_from); };
  Projection q = solve(X_start);
  refine_planes(q, solve);
  return to_penetration(X_WP, q);
}

/// Exchanges held planes until no other plane that admits the best answer improves it. solve(pose): returns
/// the answer for the held planes, searched from a pose.
template <class Solve>
void PenetrationDepth::refine_planes(Projection& best, const Solve& solve) noexcept {
  constexpr int kMaxChanges = 12;        // usually none or one
  constexpr std::size_t kMaxTries = 16;  // touching planes with the widest separation
  for (int change = 0; change < kMaxChanges; ++change) {
    if (!in_contact(best) || scene_contacts_.planes_optimal(best)) return;
    const std::size_t choices = std::min(kMaxTries, scene_contacts_.find_alternative_planes(best.X_WQ));
    bool improved = false;
    saved_planes_ = scene_contacts_.planes();
    for (std::size_t i = 0; i < choices && !improved; ++i) {
      scene_contacts_.hold_alternative(i);
      const Projection candidate_answer = solve(best.X_WQ);
      improved = candidate_answer.status != ProjectionStatus::infeasible &&
                 candidate_answer.energy < kImprovement * best.energy;
      if (improved)
        best = candidate_answer;
      else
        scene_contacts_.set_planes(saved_planes_);
    }
    if (!improved) return;
  }
}

/// Returns the best answer over the candidate planes, exchanged for one obstacle at a time. It starts from
/// the rotation of p, then from the rotation of the best answer, until a round brings no improvement.
/// Half-spaces leave no choice.
Projection PenetrationDepth::project_globally(const Pose& X_WP, const std::stop_token& stop) noexcept {
  const std::size_t alternatives = scene_contacts_.survey_planes(X_WP);
  if (alternatives == 0) return exact_.project_globally(X_WP, scene_contacts_);
  const SearchMargins margins(bodies_);
  const auto solve = [&](const Pose& X_start) { return exact_.project(X_WP, scene_contacts_, X_start); };
  Projection best = solve(X_WP);
  refine_planes(best, solve);
  best_planes_ = scene_contacts_.planes();
  const auto energy_of = [](const Projection& q) {
    return q.status == ProjectionStatus::infeasible ? std::numeric_limits<double>::infinity() : q.energy;
  };
  const auto try_all_from = [&](const Pose& X_start, bool first) {
    bool improved = false;
    for (std::size_t i = 0; i < alternatives && best.status != ProjectionStatus::free; ++i) {
      if (stop.stop_requested()) return false;
      if (scene_contacts_.survey_estimate(i) > margins.estimate * energy_of(best)) {
        first_energies_[i] = std::numeric_limits<double>::infinity();
        continue;
      }
      if (!first && !(first_energies_[i] <= margins.again * energy_of(best))) continue;
      scene_contacts_.hold_survey_plane(i);
      Projection candidate_answer = solve(X_start);
      if (first) first_energies_[i] = energy_of(candidate_answer);
      if (!(energy_of(candidate_answer) <= margins.first_answer * energy_of(best))) continue;
      refine_planes(candidate_answer, solve);
      if (!(energy_of(candidate_answer) < kImprovement * energy_of(best))) continue;
      best = candidate_answer;
      best_planes_ = scene_contacts_.planes();
      improved = true;
    }
    return improved;
  };
  constexpr int kMaxRounds = 4;
  try_all_from(X_WP, true);
  for (int round = 0; round < kMaxRounds && in_contact(best); ++round)
    if (!try_all_from(Pose(best.X_WQ), false)) break;
  scene_contacts_.set_planes(best_planes_);
  return best;
}

/// Returns the nearest translation over the touching planes.
Projection PenetrationDepth::translate(const Pose& X_WP) noexcept {
  const auto solve = [&](const Pose&) { return exact_.translate(X_WP, scene_contacts_, X_WP); };
  Projection q = solve(X_WP);
  refine_planes(q, solve);
  return q;
}

/// Derives contacts, eps and spring displacement from a projection.
Penetration PenetrationDepth::to_penetration(const Pose& X_WP, const Projection& projection) noexcept {
  Penetration out;
  out.projection = projection;
  if (!in_contact(projection)) return out;
  // A proxy that has reached its work limit may have no contact. It counts as one contact.
  out.contacts = static_cast<std::uint16_t>(std::max<std::size_t>(projection.active.size(), 1));
  out.eps = displacement(X_WP, projection.X_WQ);
  out.spring_displacement = out.eps;
  return out;
}

/// Projects each contact alone, in every plane of its family. A convex obstacle counts as the half-space of
/// its held plane. Usually one vertex collides and its projection frees the whole body; the best such
/// projection is the answer.
/// If no projection frees the body (the family tests one cross-section, and a vertex beside it may stay
/// inside), the answer is the sum of the contacts' wrenches (core/METHOD.md, section 7.3; paper, section 5).
/// The reported pose is then the best of the rotations, translated until the whole body is free. The pure
/// translation is always a candidate.
Penetration PenetrationDepth::planar(const Pose& X_WP) noexcept {
  Penetration out = to_penetration(X_WP, translate(X_WP));
  if (out.projection.status == ProjectionStatus::free) return out;
  scene_contacts_.fix_planes_to_world(X_WP);
  contacts_.clear();
  while (scene_contacts_.add_violated(X_WP, 0.0, contacts_) > 0) continue;

  bool body_freed = false;
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
      body_freed = true;
      X_WQ = candidate;
      T = one.minimum.T;
    }
    const Pose X_alone = PlanarFamily::pose(X_WP, contact, best);
    sum += displacement(X_WP, X_alone);
    if (body_freed) continue;
    const Projection translated = exact_.translate(X_WP, scene_contacts_, X_alone);
    if (!in_contact(translated) || translated.energy >= T) continue;
    X_WQ = translated.X_WQ;
    T = translated.energy;
  }
  const auto translate_out = [&](const Pose&) { return exact_.translate(X_WP, scene_contacts_, X_WQ); };
  Projection q = translate_out(X_WQ);
  refine_planes(q, translate_out);  // moves q towards p until it touches
  out = to_penetration(X_WP, q);
  out.spring_displacement = body_freed ? out.eps : sum;
  return out;
}

/// The depth of each obstacle acts at the mean of the contacts that touch it: METHOD (59).
Penetration PenetrationDepth::translational(const Pose& X_WP) noexcept {
  Penetration out = to_penetration(X_WP, translate(X_WP));
  if (!in_contact(out.projection)) return out;
  const Pose& X_WQ = out.projection.X_WQ;
  Vector3d moment = Vector3d::Zero();
  for (const auto& [contact, multiplier] : evenly_loaded_contacts(out.projection)) {
    const Vector3d lever_W = contact_point_W(contact, X_WQ) - X_WQ.translation_m;
    moment += multiplier * (X_WP.rotation.conjugate() * lever_W.cross(normal_W(contact, X_WQ)));
  }
  // From 2 m s = sum multiplier_i n_i: contact i carries the displacement multiplier_i n_i / (2 m).
  out.spring_displacement.tail<3>() = moment / (2.0 * M_.mass_kg);
  return out;
}

}  // namespace wrenchd
