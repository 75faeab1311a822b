// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/proxy.hpp"

#include <algorithm>
#include <span>
#include <utility>

#include "collision/contact_detection.hpp"
#include "core/metric.hpp"

namespace wrenchd {
namespace {

/// Longest step of the proxy: this multiple of the hand's displacement in the tick, and at least this
/// fraction of the tool's size. If a contact is not known yet, the projection may lie far away. A sweep of
/// the whole path there would be the most expensive one, so the proxy takes the path in parts: METHOD (93).
constexpr double kMaxStepFactor = 3.0;
constexpr double kMinStep = 0.002;
/// Largest rotation of a step [rad]. Points deviate from the straight path by angle^2 / 8 times their
/// distance.
constexpr double kMaxTurn_rad = 0.05;
/// The tick ends if the remaining fraction of a step is smaller than this.
constexpr double kMinFraction = 1.0 / 1024.0;
/// If a path was too long, the next tick starts with the shorter path that succeeded, but not with less than
/// this fraction.
constexpr double kMinFirstFraction = 1.0 / 64.0;
/// After a contact was dropped, the tool usually meets another one nearby. The first step is then this
/// fraction, and each following step may be longer by the factor kGrowthAfterFree.
constexpr double kCautiousFraction = 1.0 / 64.0;
constexpr double kGrowthAfterFree = 4.0;
/// Growth of the longest step on a long free path.
constexpr double kStepGrowth = 1.5;
/// If the hand moves by at most this per tick, in units of the tool's size, the tool may lag by some ticks.
constexpr double kSlowHand = 0.005;
/// The prefetch may fill a tick up to this multiple of the target.
constexpr double kPrefetchLimit = 1.35;
/// Cost of a sweep and of the step before it, beside the counted node visits.
constexpr std::uint32_t kVisitsPerSweep = 18;
/// A tick always has this number of sweeps.
constexpr int kMinSweeps = 3;
/// The proxy moves along this fraction of the part that the candidate list covers.
constexpr double kCoveredFraction = 0.9;
/// Minimum gap at which a contact is held open, as a multiple of the clearance.
constexpr double kMinClearance = 0.2;
/// The tool is trapped if obstacles could not displace the proxy for this number of ticks.
constexpr std::uint16_t kMaxTrappedTicks = 50;
/// A displacement by obstacles has no step limit.
constexpr ExactProjection::StepLimit kNoStepLimit = {};
/// Minimum relative decrease of T per round. Below it the round made no progress.
constexpr double kIdleDecrease = 1e-9;
/// The tick ends after this number of rounds without progress in sequence.
constexpr int kMaxIdleRounds = 3;

/// Returns true if all contacts are open at a pose, to half the clearance.
bool all_open(std::span<const ActiveContact> contacts, const Pose& X_WT) noexcept {
  return std::all_of(contacts.begin(), contacts.end(), [&](const ActiveContact& active) {
    return gap_m(active.contact, X_WT) >= 0.5 * Proxy::kClearance_m;
  });
}

}  // namespace

Proxy::Proxy(const Scene& scene, WorkLimit effort, ContactBackend contacts)
    : scene_(scene),
      work_limit_(effort),
      M_(scene.tool().solid.inertia),
      exact_(M_, ExactProjection::Budget{}, kClearance_m),
      half_spaces_(scene),
      meshes_(make_sweep_query(scene, contacts)) {
  // The balancer counts node visits, which CGAL's trees do not report.
  if (contacts == ContactBackend::cgal) work_limit_.balanced = false;
}

void Proxy::hold(const Pose& X_last) noexcept {
  sweeps_ = 0;
  set_budget(0.0);
  prefetch(X_last, X_last);
}

Projection Proxy::follow(const Pose& X_WP, const Pose& X_last, double time_s) noexcept {
  X_WQ_ = X_last;
  sweeps_ = 0;
  iterations_ = 0;
  set_budget(X_last_WP_ ? displacement_bound_m(*X_last_WP_, X_WP) : 0.0);
  meshes_->set_start(X_WQ_, admissible_time_s_);
  const Projection q = solve(X_WP, time_s);
  if (!deferred_) first_step_fraction_ = 1.0;
  prefetch(q.X_WQ, X_WP);
  return q;
}

/// hand_m: displacement of the hand in this tick [m]. Where obstacles move, no work is deferred: an obstacle
/// could approach unseen.
void Proxy::set_budget(double hand_m) noexcept {
  deferred_ = false;
  min_remaining_visits_ = 0;
  budget_ = {work_limit_.node_visits};
  if (!work_limit_.balanced || scene_.has_moving_obstacles()) return;
  const double urgency = std::max(1.0, hand_m / (kSlowHand * scene_.tool_radius_m()));
  const std::uint32_t max_visits = balancer_.max_visits(urgency);
  min_remaining_visits_ = work_limit_.node_visits - std::min(work_limit_.node_visits, max_visits);
  const auto list_budget =
      static_cast<std::uint32_t>(std::max<double>(max_visits - balancer_.typical_sweep_visits(), 0.0));
  budget_.reserved = work_limit_.node_visits - std::min(work_limit_.node_visits, list_budget);
}

/// A tick above the target leaves prefetching to ticks below it.
void Proxy::prefetch(const Pose& X_WT, const Pose& X_WP) noexcept {
  std::uint32_t spare_visits = 0;
  if (budget_.reserved > 0) {
    const double target = balancer_.target_visits();
    const auto prefetch_end =
        static_cast<std::uint32_t>(std::min<double>(kPrefetchLimit * target, work_limit_.node_visits));
    budget_.reserved = std::max(budget_.reserved, work_limit_.node_visits - prefetch_end);
    spare_visits = static_cast<std::uint32_t>(std::max(target - node_visits(), 0.0));
  }
  const std::uint32_t sweep_visits = meshes_->sweep_visits() + sweeps_ * kVisitsPerSweep;
  meshes_->prefetch(X_WT, X_WP, budget_, admissible_time_s_, spare_visits);
  balancer_.update(sweep_visits, meshes_->list_visits_per_tick(), deferred_);
}

bool Proxy::target_reached() const noexcept {
  return sweeps_ >= kMinSweeps && budget_.remaining <= min_remaining_visits_;
}

void Proxy::clear_history(double time_s) noexcept {
  known_contacts_.clear();
  X_last_WP_.reset();
  meshes_->reset();
  balancer_.reset();
  first_step_fraction_ = 1.0;
  admissible_time_s_ = known_contacts_time_s_ = time_s;
  trapped_ticks_ = 0;
}

Projection Proxy::solve(const Pose& X_WP, double time_s) noexcept {
  if (scene_.has_moving_obstacles() && time_s != admissible_time_s_ && !yield_to_obstacles(time_s))
    return unfinished_answer(X_WP);
  double longest_m = std::max(kMaxStepFactor * (X_last_WP_ ? displacement_bound_m(*X_last_WP_, X_WP) : 0.0),
                              kMinStep * scene_.tool_radius_m());
  X_last_WP_ = X_WP;
  double fraction = first_step_fraction_;  // fraction of the longest step
  double T_last = energy(M_, X_WP, X_WQ_);
  int idle_rounds = 0;
  while (sweeps_ < work_limit_.sweeps && fraction >= kMinFraction) {
    const Projection q = step(X_WP, fraction * longest_m);
    // The known contacts may contradict each other where others would not.
    if (q.status == ProjectionStatus::infeasible) {
      if (known_contacts_.empty()) break;
      known_contacts_.clear();
      fraction = kCautiousFraction;
      ++sweeps_;
      continue;
    }
    const bool reaches_optimum =
        q.status == ProjectionStatus::converged || q.status == ProjectionStatus::free;
    const PathResult result = sweep_along(q.X_WQ, admissible_time_s_);
    if (result == PathResult::contacts_found) {
      if (deferred_ && target_reached()) break;  // the contacts are known in the next tick
      fraction = 1.0;
      continue;
    }
    if (result == PathResult::path_too_long) {
      fraction *= 0.25;
      first_step_fraction_ = std::max(fraction, kMinFirstFraction);
      continue;
    }
    // The proxy moves as far as the current list covers the path. The rest waits for the next tick.
    if (result == PathResult::list_pending) {
      if (std::exchange(deferred_, true)) break;
      const double distance_m =
          std::max((q.X_WQ.translation_m - X_WQ_.translation_m).norm(),
                   scene_.tool_radius_m() * q.X_WQ.rotation.angularDistance(X_WQ_.rotation));
      fraction =
          std::min(fraction, kCoveredFraction * meshes_->covered_fraction(q.X_WQ) * distance_m / longest_m);
      continue;
    }
    first_step_fraction_ = 1.0;
    X_WQ_ = q.X_WQ;
    meshes_->set_start(X_WQ_, admissible_time_s_);
    if (deferred_) break;
    if (meshes_->candidate_count() == 0) longest_m *= kGrowthAfterFree;  // no obstacle is near
    const bool all_kept = !drop_separated_contacts(q);
    fraction = all_kept ? std::min(1.0, kGrowthAfterFree * fraction) : kCautiousFraction;
    if (!all_kept && target_reached()) {
      deferred_ = true;
      break;
    }
    if (all_kept && reaches_optimum) return finish(X_WP, q);
    if (all_kept && fraction == 1.0) longest_m *= kStepGrowth;  // a long free path
    if (!reaches_optimum && fraction < 1.0) continue;
    const double T = energy(M_, X_WP, X_WQ_);
    const bool idle = T > (1.0 - kIdleDecrease) * T_last;
    idle_rounds = idle ? idle_rounds + 1 : 0;
    T_last = T;
    if (!idle) continue;
    // Either the contacts that remain balance the pull, or the next round may find the one that is missing.
    const Projection held = held_answer(X_WP);
    if (held.status == ProjectionStatus::converged || all_kept || idle_rounds == kMaxIdleRounds) return held;
  }
  return unfinished_answer(X_WP);
}

/// Returns the present pose with the known contacts. The status is converged if they balance the pull.
Projection Proxy::held_answer(const Pose& X_WP) noexcept {
  Projection q;
  q.X_WQ = X_WQ_;
  q.active = known_contacts_;
  exact_.balance(X_WP, q);
  q.status =
      q.kkt_residual <= kOptimalResidual ? ProjectionStatus::converged : ProjectionStatus::budget_spent;
  return finish(X_WP, q);
}

/// Returns the pose reached so far.
Projection Proxy::unfinished_answer(const Pose& X_WP) noexcept {
  Projection q = held_answer(X_WP);
  q.status =
      trapped_ticks_ < kMaxTrappedTicks ? ProjectionStatus::budget_spent : ProjectionStatus::infeasible;
  return q;
}

/// Displaces the proxy while the obstacles move to their poses at time_s, in several parts if necessary.
/// Returns false if it did not reach time_s.
bool Proxy::yield_to_obstacles(double time_s) noexcept {
  const double start_s = admissible_time_s_;
  double fraction = 1.0;  // fraction of the remaining time
  while (admissible_time_s_ != time_s && sweeps_ < work_limit_.sweeps && fraction >= kMinFraction) {
    const double next_s =
        fraction < 1.0 ? admissible_time_s_ + fraction * (time_s - admissible_time_s_) : time_s;
    move_known_contacts(next_s);
    Projection q;
    q.X_WQ = X_WQ_;
    q.active = known_contacts_;
    if (!all_open({known_contacts_.begin(), known_contacts_.end()}, X_WQ_)) {
      q = exact_.step(X_WQ_, X_WQ_,
                      std::span<const ActiveContact>(known_contacts_.begin(), known_contacts_.end()),
                      kNoStepLimit);
      iterations_ = static_cast<std::uint16_t>(iterations_ + q.iterations);
    }
    const bool consistent = q.status != ProjectionStatus::infeasible;
    const PathResult result = consistent ? sweep_along(q.X_WQ, next_s) : PathResult::path_too_long;
    if (result == PathResult::contacts_found) continue;
    if (result != PathResult::free) {
      if (!consistent) known_contacts_.clear();
      fraction *= 0.25;
      continue;
    }
    X_WQ_ = q.X_WQ;
    admissible_time_s_ = next_s;
    meshes_->set_start(X_WQ_, admissible_time_s_);
    drop_separated_contacts(q);
    fraction = std::min(1.0, kGrowthAfterFree * fraction);
  }
  move_known_contacts(admissible_time_s_);
  if (admissible_time_s_ != start_s)
    trapped_ticks_ = 0;
  else if (trapped_ticks_ < kMaxTrappedTicks)
    ++trapped_ticks_;
  return admissible_time_s_ == time_s;
}

/// Moves the known contacts to the obstacle poses at this time.
void Proxy::move_known_contacts(double time_s) noexcept {
  if (time_s == known_contacts_time_s_) return;
  KnownContacts moved_contacts;
  for (const auto& [contact, multiplier] : known_contacts_)
    moved_contacts.add({contact_at(contact, known_contacts_time_s_, time_s), multiplier});
  known_contacts_ = moved_contacts;
  known_contacts_time_s_ = time_s;
}

/// Returns a contact with its obstacle moved from one scene time to another: METHOD (27).
Contact Proxy::contact_at(const Contact& contact, double from_s, double to_s) const noexcept {
  if (!scene_.has_moving_obstacles() || from_s == to_s) return contact;
  return moved(contact, scene_.obstacle_displacement(contact.obstacle, from_s, to_s));
}

/// Returns the pose nearest to p that the known contacts admit, at most longest_m from the present pose.
Projection Proxy::step(const Pose& X_WP, double longest_m) noexcept {
  const ExactProjection::StepLimit step_limit = {longest_m,
                                                 std::min(longest_m / scene_.tool_radius_m(), kMaxTurn_rad)};
  const Projection q =
      exact_.step(X_WP, X_WQ_, std::span<const ActiveContact>(known_contacts_.begin(), known_contacts_.end()),
                  step_limit);
  iterations_ = static_cast<std::uint16_t>(iterations_ + q.iterations);
  return q;
}

/// METHOD (92).
double Proxy::displacement_bound_m(const Pose& from, const Pose& to) const noexcept {
  return (to.translation_m - from.translation_m).norm() +
         scene_.tool_radius_m() * from.rotation.angularDistance(to.rotation);
}

/// Sweeps the path from the present pose and adds the contacts that the tool meets.
Proxy::PathResult Proxy::sweep_along(const Pose& X_WT, double time_s) noexcept {
  ++sweeps_;
  budget_.remaining -= std::min(budget_.remaining, kVisitsPerSweep);
  bool found_new = false;
  ContactSet met;
  const double tolerance_m = exact_.gap_tolerance_m(X_WT) - kClearance_m;
  half_spaces_.add_violated(Frame(X_WT), tolerance_m, met);
  for (const Contact& contact : met) found_new = add_known_contact(contact) || found_new;
  if (scene_.meshes().empty()) return found_new ? PathResult::contacts_found : PathResult::free;
  const SweepQuery::SweepResult found = meshes_->sweep(X_WT, kClearance_m, budget_, time_s);
  if (!found.complete) return found.list_pending ? PathResult::list_pending : PathResult::path_too_long;
  for (const Contact& contact : found.contacts) found_new = add_known_contact(contact) || found_new;
  if (found_new) return PathResult::contacts_found;
  return found.overlaps || !found.contacts.empty() || !met.empty() ? PathResult::path_too_long
                                                                   : PathResult::free;
}

/// Returns false if the contact is known or there is no room. If its gap is already below the clearance, the
/// contact is held at that gap, so that the present pose remains admissible.
bool Proxy::add_known_contact(Contact contact) noexcept {
  for (const ActiveContact& known : known_contacts_)
    if (same_features(known.contact, contact)) return false;
  const double gap = gap_m(contact_at(contact, known_contacts_time_s_, admissible_time_s_), X_WQ_);
  if (gap < kClearance_m) {
    const double gap_reduction_m = kClearance_m - std::max(gap, kMinClearance * kClearance_m);
    contact.p_WCb_m -= gap_reduction_m * normal_W(contact, X_WQ_);
    contact.offset_m -= gap_reduction_m;
  }
  return known_contacts_.add({contact, 0.0});
}

/// Keeps the contacts that touch at q with features that face each other. Returns true if it dropped a loaded
/// contact.
bool Proxy::drop_separated_contacts(const Projection& q) noexcept {
  bool dropped_loaded = false;
  known_contacts_.clear();
  for (const ActiveContact& active : q.active) {
    if (active.contact.obstacle < scene_.first_mesh() || meshes_->touching().contains(active.contact))
      known_contacts_.add(active);
    else
      dropped_loaded = dropped_loaded || active.multiplier > 0.0;
  }
  return dropped_loaded;
}

/// Adds energy and iteration count for p.
Projection Proxy::finish(const Pose& X_WP, Projection q) const noexcept {
  q.iterations = iterations_;
  q.energy = q.status == ProjectionStatus::free ? 0.0 : energy(M_, X_WP, q.X_WQ);
  return q;
}

}  // namespace wrenchd
