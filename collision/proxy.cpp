// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/proxy.hpp"

#include <algorithm>
#include <span>
#include <utility>

#include "core/metric.hpp"

namespace wrenchd {
namespace {

/// No step is longer than so many times what the hand has moved since the last tick, or this share of the
/// tool's size: where a candidate lies far away, for want of a contact that is about to be met, the long way
/// there would be the dearest of all to look along. It is gone in parts.
constexpr double kLongestStep = 3.0;
constexpr double kLeastStep = 0.002;
/// Nor does it turn farther than this [rad]: points leave the straight way by angle^2 / 8 of their distance.
constexpr double kLongestTurn_rad = 0.05;
/// A way this short, as a share of the step, is not worth going.
constexpr double kShortestShare = 1.0 / 1024.0;
/// Where a way was too long and a shorter one waits for its list, the next tick begins with the shorter one,
/// but not with less than this.
constexpr double kLeastFirstShare = 1.0 / 64.0;
/// Where a contact has let go, another is about to be met near by, most often: the first step is a short one,
/// and every next may be longer.
constexpr double kWary = 1.0 / 64.0;
constexpr double kLonger = 4.0;
/// A way that is long and free is gone in steps that grow by so much.
constexpr double kGrowth = 1.5;
/// A hand that moves by no more than this in a tick, in units of the tool's size, can wait for a tool that is
/// some ticks late.
constexpr double kPatientWay = 0.005;
/// What is made ahead may fill a tick up to so many times what ticks are brought up to.
constexpr double kAheadUpTo = 1.35;
/// A look, the step before it included, takes the time of so many visits beside those that it counts.
constexpr std::uint32_t kVisitsPerLook = 18;
/// So many looks are always taken.
constexpr int kFewLooks = 3;
/// Of the share of a way that can be looked at, this much is gone.
constexpr double kSafely = 0.9;
/// The least that a contact is held open by, in units of the clearance.
constexpr double kLeastClearance = 0.2;
/// A proxy that obstacles cannot push aside for so many ticks is caught between them.
constexpr std::uint16_t kMostStuckTicks = 50;
/// What is pushed goes as far as it must.
constexpr ExactProjection::StepLimit kNoLeash = {};
/// T falls by at least this share from one round to the next, or the rounds end.
constexpr double kProgress = 1e-9;

/// Are these contacts all open at a pose, as far as they are held?
bool holds(std::span<const ActiveContact> contacts, const Pose& X_WT) noexcept {
  return std::all_of(contacts.begin(), contacts.end(), [&](const ActiveContact& active) {
    return gap_m(active.contact, X_WT) >= 0.5 * Proxy::kClearance_m;
  });
}

}  // namespace

Proxy::Proxy(const Scene& scene, WorkLimit effort)
    : scene_(scene),
      work_limit_(effort),
      M_(scene.tool().solid.inertia),
      exact_(M_, ExactProjection::Budget{}, kClearance_m),
      half_spaces_(scene),
      meshes_(scene) {}

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
  meshes_.set_start(X_WQ_, admissible_time_s_);
  const Projection q = solve(X_WP, time_s);
  if (!deferred_) first_step_fraction_ = 1.0;
  prefetch(q.X_WQ, X_WP);
  return q;
}

/// hand_m: how far the hand has come with this tick. Where obstacles move nothing can wait: what is late
/// would let them come nearer unseen.
void Proxy::set_budget(double hand_m) noexcept {
  deferred_ = false;
  min_remaining_visits_ = 0;
  budget_ = {work_limit_.node_visits};
  if (!work_limit_.balanced || scene_.has_moving_obstacles()) return;
  const double haste = std::max(1.0, hand_m / (kPatientWay * scene_.tool_radius_m()));
  const std::uint32_t most = balancer_.max_visits(haste);
  min_remaining_visits_ = work_limit_.node_visits - std::min(work_limit_.node_visits, most);
  const auto for_lists =
      static_cast<std::uint32_t>(std::max<double>(most - balancer_.typical_sweep_visits(), 0.0));
  budget_.reserved = work_limit_.node_visits - std::min(work_limit_.node_visits, for_lists);
}

/// A tick that had much to do leaves what is made ahead to others, which had little.
void Proxy::prefetch(const Pose& X_WT, const Pose& X_WP) noexcept {
  std::uint32_t to_spare = 0;
  if (budget_.reserved > 0) {
    const double even = balancer_.target_visits();
    const auto for_all =
        static_cast<std::uint32_t>(std::min<double>(kAheadUpTo * even, work_limit_.node_visits));
    budget_.reserved = std::max(budget_.reserved, work_limit_.node_visits - for_all);
    to_spare = static_cast<std::uint32_t>(std::max(even - node_visits(), 0.0));
  }
  const std::uint32_t looking = meshes_.sweep_visits() + sweeps_ * kVisitsPerLook;
  meshes_.prefetch(X_WT, X_WP, budget_, admissible_time_s_, to_spare);
  balancer_.update(looking, meshes_.list_visits_per_tick(), deferred_);
}

bool Proxy::target_reached() const noexcept {
  return sweeps_ >= kFewLooks && budget_.remaining <= min_remaining_visits_;
}

void Proxy::clear_history(double time_s) noexcept {
  known_contacts_.clear();
  X_last_WP_.reset();
  meshes_.reset();
  balancer_.reset();
  first_step_fraction_ = 1.0;
  admissible_time_s_ = known_contacts_time_s_ = time_s;
  trapped_ticks_ = 0;
}

Projection Proxy::solve(const Pose& X_WP, double time_s) noexcept {
  if (scene_.has_moving_obstacles() && time_s != admissible_time_s_ && !yield_to_obstacles(time_s))
    return unfinished_answer(X_WP);
  double longest_m = std::max(kLongestStep * (X_last_WP_ ? displacement_bound_m(*X_last_WP_, X_WP) : 0.0),
                              kLeastStep * scene_.tool_radius_m());
  X_last_WP_ = X_WP;
  double share = first_step_fraction_;  // of the step that the contacts known allow
  double T_last = energy(M_, X_WP, X_WQ_);
  while (sweeps_ < work_limit_.sweeps && share >= kShortestShare) {
    const Projection q = step(X_WP, share * longest_m);
    if (q.status == ProjectionStatus::infeasible) {  // contacts that do not agree: others may
      if (known_contacts_.empty()) break;
      known_contacts_.clear();
      share = kWary;
      ++sweeps_;
      continue;
    }
    const bool whole = q.status == ProjectionStatus::converged || q.status == ProjectionStatus::free;
    const PathResult way = sweep_along(q.X_WQ, admissible_time_s_);
    if (way == PathResult::contacts_found) {
      if (deferred_ && target_reached()) break;  // they are known in the next tick
      share = 1.0;
      continue;
    }
    if (way == PathResult::path_too_long) {
      share *= 0.25;
      first_step_fraction_ = std::max(share, kLeastFirstShare);
      continue;
    }
    if (way == PathResult::list_pending) {  // as far as is known; the rest waits
      if (std::exchange(deferred_, true)) break;
      const double far_m = std::max((q.X_WQ.translation_m - X_WQ_.translation_m).norm(),
                                    scene_.tool_radius_m() * q.X_WQ.rotation.angularDistance(X_WQ_.rotation));
      share = std::min(share, kSafely * meshes_.covered_fraction(q.X_WQ) * far_m / longest_m);
      continue;
    }
    first_step_fraction_ = 1.0;
    X_WQ_ = q.X_WQ;
    meshes_.set_start(X_WQ_, admissible_time_s_);
    if (deferred_) break;
    if (meshes_.candidate_count() == 0) longest_m *= kLonger;  // nothing near
    const bool all_hold = !drop_separated_contacts(q);
    share = all_hold ? std::min(1.0, kLonger * share) : kWary;
    if (!all_hold && target_reached()) {
      deferred_ = true;
      break;
    }
    if (!whole) {
      if (all_hold && share == 1.0) longest_m *= kGrowth;  // a long way to go, and nothing on it
      continue;
    }
    if (all_hold) return finish(X_WP, q);
    const double T = energy(M_, X_WP, X_WQ_);
    if (T > (1.0 - kProgress) * T_last) return finish(X_WP, q);
    T_last = T;
  }
  return unfinished_answer(X_WP);
}

/// As far as it came.
Projection Proxy::unfinished_answer(const Pose& X_WP) const noexcept {
  Projection q;
  q.status = trapped_ticks_ < kMostStuckTicks ? ProjectionStatus::budget_spent : ProjectionStatus::infeasible;
  q.X_WQ = X_WQ_;
  q.active = known_contacts_;
  return finish(X_WP, q);
}

/// Lets the obstacles move to where they stand at time_s, in parts where it takes that. False where they are
/// on their way still.
bool Proxy::yield_to_obstacles(double time_s) noexcept {
  const double since_s = admissible_time_s_;
  double share = 1.0;  // of the time that is left
  while (admissible_time_s_ != time_s && sweeps_ < work_limit_.sweeps && share >= kShortestShare) {
    const double next_s = share < 1.0 ? admissible_time_s_ + share * (time_s - admissible_time_s_) : time_s;
    move_known_contacts(next_s);
    Projection q;
    q.X_WQ = X_WQ_;
    q.active = known_contacts_;
    if (!holds({known_contacts_.begin(), known_contacts_.end()}, X_WQ_)) {
      q = exact_.step(X_WQ_, X_WQ_,
                      std::span<const ActiveContact>(known_contacts_.begin(), known_contacts_.end()),
                      kNoLeash);
      iterations_ = static_cast<std::uint16_t>(iterations_ + q.iterations);
    }
    const bool agree = q.status != ProjectionStatus::infeasible;
    const PathResult way = agree ? sweep_along(q.X_WQ, next_s) : PathResult::path_too_long;
    if (way == PathResult::contacts_found) continue;
    if (way != PathResult::free) {
      if (!agree) known_contacts_.clear();
      share *= 0.25;
      continue;
    }
    X_WQ_ = q.X_WQ;
    admissible_time_s_ = next_s;
    meshes_.set_start(X_WQ_, admissible_time_s_);
    drop_separated_contacts(q);
    share = std::min(1.0, kLonger * share);
  }
  move_known_contacts(admissible_time_s_);
  if (admissible_time_s_ != since_s)
    trapped_ticks_ = 0;
  else if (trapped_ticks_ < kMostStuckTicks)
    ++trapped_ticks_;
  return admissible_time_s_ == time_s;
}

/// The known contacts as they stand at this time.
void Proxy::move_known_contacts(double time_s) noexcept {
  if (time_s == known_contacts_time_s_) return;
  KnownContacts seen;
  for (const auto& [contact, multiplier] : known_contacts_)
    seen.add({contact_at(contact, known_contacts_time_s_, time_s), multiplier});
  known_contacts_ = seen;
  known_contacts_time_s_ = time_s;
}

/// A contact of one time at another.
Contact Proxy::contact_at(const Contact& contact, double from_s, double to_s) const noexcept {
  if (!scene_.has_moving_obstacles() || from_s == to_s) return contact;
  return moved(contact, scene_.obstacle_displacement(contact.obstacle, from_s, to_s));
}

/// As near to p as the contacts known allow, no farther than so much from the pose at hand.
Projection Proxy::step(const Pose& X_WP, double longest_m) noexcept {
  const ExactProjection::StepLimit leash = {longest_m,
                                            std::min(longest_m / scene_.tool_radius_m(), kLongestTurn_rad)};
  const Projection q = exact_.step(
      X_WP, X_WQ_, std::span<const ActiveContact>(known_contacts_.begin(), known_contacts_.end()), leash);
  iterations_ = static_cast<std::uint16_t>(iterations_ + q.iterations);
  return q;
}

/// How far a point of the tool may be moved from one pose to the other.
double Proxy::displacement_bound_m(const Pose& from, const Pose& to) const noexcept {
  return (to.translation_m - from.translation_m).norm() +
         scene_.tool_radius_m() * from.rotation.angularDistance(to.rotation);
}

/// Looks along the way from the pose at hand; what it meets there becomes known.
Proxy::PathResult Proxy::sweep_along(const Pose& X_WT, double time_s) noexcept {
  ++sweeps_;
  budget_.remaining -= std::min(budget_.remaining, kVisitsPerLook);
  bool learned = false;
  ContactSet met;
  const double tolerance_m = exact_.gap_tolerance_m(X_WT) - kClearance_m;
  half_spaces_.add_violated(Frame(X_WT), tolerance_m, met);
  for (const Contact& contact : met) learned = add_known_contact(contact) || learned;
  if (scene_.meshes().empty()) return learned ? PathResult::contacts_found : PathResult::free;
  const MeshContacts::SweepResult found = meshes_.sweep(X_WT, kClearance_m, budget_, time_s);
  if (!found.complete) return found.list_pending ? PathResult::list_pending : PathResult::path_too_long;
  for (const Contact& contact : found.contacts) learned = add_known_contact(contact) || learned;
  if (learned) return PathResult::contacts_found;
  return found.overlaps || !found.contacts.empty() || !met.empty() ? PathResult::path_too_long
                                                                   : PathResult::free;
}

/// False where it was known, or there is no room. A contact that has less room already is held where it is:
/// the pose at hand must remain one of those allowed.
bool Proxy::add_known_contact(Contact contact) noexcept {
  for (const ActiveContact& known : known_contacts_)
    if (same_features(known.contact, contact)) return false;
  const double gap = gap_m(contact_at(contact, known_contacts_time_s_, admissible_time_s_), X_WQ_);
  if (gap < kClearance_m) {
    const double lower_m = kClearance_m - std::max(gap, kLeastClearance * kClearance_m);
    contact.p_WCb_m -= lower_m * normal_W(contact, X_WQ_);
    contact.offset_m -= lower_m;
  }
  return known_contacts_.add({contact, 0.0});
}

/// Keeps the contacts that touch at q and whose features lie opposite each other there. True where one that
/// carried is not among them.
bool Proxy::drop_separated_contacts(const Projection& q) noexcept {
  bool carried = false;
  known_contacts_.clear();
  for (const ActiveContact& active : q.active) {
    if (active.contact.obstacle < scene_.first_mesh() || meshes_.touching().contains(active.contact))
      known_contacts_.add(active);
    else
      carried = carried || active.multiplier > 0.0;
  }
  return carried;
}

/// q with what it is for p, whatever it was found for.
Projection Proxy::finish(const Pose& X_WP, Projection q) const noexcept {
  q.iterations = iterations_;
  q.energy = q.status == ProjectionStatus::free ? 0.0 : energy(M_, X_WP, q.X_WQ);
  return q;
}

}  // namespace wrenchd
