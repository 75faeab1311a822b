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
constexpr ExactProjection::Leash kNoLeash = {};
/// T falls by at least this share from one round to the next, or the rounds end.
constexpr double kProgress = 1e-9;

/// Are these contacts all open at a pose, as far as they are held?
bool holds(std::span<const ActiveContact> contacts, const Pose& X_WT) noexcept {
  return std::all_of(contacts.begin(), contacts.end(), [&](const ActiveContact& active) {
    return gap_m(active.contact, X_WT) >= 0.5 * Proxy::kClearance_m;
  });
}

}  // namespace

Proxy::Proxy(const Scene& scene, Effort effort)
    : scene_(scene),
      effort_(effort),
      M_(scene.tool().solid.inertia),
      exact_(M_, ExactProjection::Budget{}, kClearance_m),
      half_spaces_(scene),
      meshes_(scene) {}

void Proxy::stay(const Pose& X_last) noexcept {
  looks_ = 0;
  set_budget(0.0);
  look_ahead(X_last, X_last);
}

Projection Proxy::follow(const Pose& X_WP, const Pose& X_last, double time_s) noexcept {
  X_WQ_ = X_last;
  looks_ = 0;
  iterations_ = 0;
  set_budget(X_asked_ ? way_m(*X_asked_, X_WP) : 0.0);
  meshes_.start_at(X_WQ_, seen_s_);
  const Projection q = find(X_WP, time_s);
  if (!late_) first_share_ = 1.0;
  look_ahead(q.X_WQ, X_WP);
  return q;
}

/// hand_m: how far the hand has come with this tick. Where obstacles move nothing can wait: what is late
/// would let them come nearer unseen.
void Proxy::set_budget(double hand_m) noexcept {
  late_ = false;
  least_left_ = 0;
  budget_ = {effort_.visits};
  if (!effort_.evenly || scene_.moves()) return;
  const double haste = std::max(1.0, hand_m / (kPatientWay * scene_.tool_radius_m()));
  const std::uint32_t most = even_.most(haste);
  least_left_ = effort_.visits - std::min(effort_.visits, most);
  const auto for_lists = static_cast<std::uint32_t>(std::max<double>(most - even_.usual_of_looks(), 0.0));
  budget_.kept = effort_.visits - std::min(effort_.visits, for_lists);
}

/// A tick that had much to do leaves what is made ahead to others, which had little.
void Proxy::look_ahead(const Pose& X_WT, const Pose& X_WP) noexcept {
  std::uint32_t to_spare = 0;
  if (budget_.kept > 0) {
    const double even = even_.even();
    const auto for_all = static_cast<std::uint32_t>(std::min<double>(kAheadUpTo * even, effort_.visits));
    budget_.kept = std::max(budget_.kept, effort_.visits - for_all);
    to_spare = static_cast<std::uint32_t>(std::max(even - visits(), 0.0));
  }
  const std::uint32_t looking = meshes_.looking() + looks_ * kVisitsPerLook;
  meshes_.look_ahead(X_WT, X_WP, budget_, seen_s_, to_spare);
  even_.learn(looking, meshes_.visits_per_tick(), late_);
}

bool Proxy::worked_enough() const noexcept {
  return looks_ >= kFewLooks && budget_.visits <= least_left_;
}

void Proxy::forget(double time_s) noexcept {
  known_.clear();
  X_asked_.reset();
  meshes_.forget();
  even_.forget();
  first_share_ = 1.0;
  seen_s_ = known_s_ = time_s;
  stuck_ticks_ = 0;
}

Projection Proxy::find(const Pose& X_WP, double time_s) noexcept {
  if (scene_.moves() && time_s != seen_s_ && !give_way(time_s)) return waiting(X_WP);
  double longest_m =
      std::max(kLongestStep * (X_asked_ ? way_m(*X_asked_, X_WP) : 0.0), kLeastStep * scene_.tool_radius_m());
  X_asked_ = X_WP;
  double share = first_share_;  // of the step that the contacts known allow
  double T_last = energy(M_, X_WP, X_WQ_);
  while (looks_ < effort_.looks && share >= kShortestShare) {
    const Projection q = step(X_WP, share * longest_m);
    if (q.status == ProjectionStatus::infeasible) {  // contacts that do not agree: others may
      if (known_.empty()) break;
      known_.clear();
      share = kWary;
      ++looks_;
      continue;
    }
    const bool whole = q.status == ProjectionStatus::converged || q.status == ProjectionStatus::free;
    const Way way = look_along(q.X_WQ, seen_s_);
    if (way == Way::met_contacts) {
      if (late_ && worked_enough()) break;  // they are known in the next tick
      share = 1.0;
      continue;
    }
    if (way == Way::too_long) {
      share *= 0.25;
      first_share_ = std::max(share, kLeastFirstShare);
      continue;
    }
    if (way == Way::late) {  // as far as is known; the rest waits
      if (std::exchange(late_, true)) break;
      const double far_m = std::max((q.X_WQ.translation_m - X_WQ_.translation_m).norm(),
                                    scene_.tool_radius_m() * q.X_WQ.rotation.angularDistance(X_WQ_.rotation));
      share = std::min(share, kSafely * meshes_.share_listed(q.X_WQ) * far_m / longest_m);
      continue;
    }
    first_share_ = 1.0;
    X_WQ_ = q.X_WQ;
    meshes_.start_at(X_WQ_, seen_s_);
    if (late_) break;
    if (meshes_.pairs() == 0) longest_m *= kLonger;  // nothing near
    const bool all_hold = !let_go(q);
    share = all_hold ? std::min(1.0, kLonger * share) : kWary;
    if (!all_hold && worked_enough()) {
      late_ = true;
      break;
    }
    if (!whole) {
      if (all_hold && share == 1.0) longest_m *= kGrowth;  // a long way to go, and nothing on it
      continue;
    }
    if (all_hold) return described(X_WP, q);
    const double T = energy(M_, X_WP, X_WQ_);
    if (T > (1.0 - kProgress) * T_last) return described(X_WP, q);
    T_last = T;
  }
  return waiting(X_WP);
}

/// As far as it came.
Projection Proxy::waiting(const Pose& X_WP) const noexcept {
  Projection q;
  q.status = stuck_ticks_ < kMostStuckTicks ? ProjectionStatus::budget_spent : ProjectionStatus::infeasible;
  q.X_WQ = X_WQ_;
  q.active = known_;
  return described(X_WP, q);
}

/// Lets the obstacles move to where they stand at time_s, in parts where it takes that. False where they are
/// on their way still.
bool Proxy::give_way(double time_s) noexcept {
  const double since_s = seen_s_;
  double share = 1.0;  // of the time that is left
  while (seen_s_ != time_s && looks_ < effort_.looks && share >= kShortestShare) {
    const double next_s = share < 1.0 ? seen_s_ + share * (time_s - seen_s_) : time_s;
    see(next_s);
    Projection q;
    q.X_WQ = X_WQ_;
    q.active = known_;
    if (!holds({known_.begin(), known_.end()}, X_WQ_)) {
      q = exact_.step(X_WQ_, X_WQ_, std::span<const ActiveContact>(known_.begin(), known_.end()), kNoLeash);
      iterations_ = static_cast<std::uint16_t>(iterations_ + q.iterations);
    }
    const bool agree = q.status != ProjectionStatus::infeasible;
    const Way way = agree ? look_along(q.X_WQ, next_s) : Way::too_long;
    if (way == Way::met_contacts) continue;
    if (way != Way::free) {
      if (!agree) known_.clear();
      share *= 0.25;
      continue;
    }
    X_WQ_ = q.X_WQ;
    seen_s_ = next_s;
    meshes_.start_at(X_WQ_, seen_s_);
    let_go(q);
    share = std::min(1.0, kLonger * share);
  }
  see(seen_s_);
  if (seen_s_ != since_s)
    stuck_ticks_ = 0;
  else if (stuck_ticks_ < kMostStuckTicks)
    ++stuck_ticks_;
  return seen_s_ == time_s;
}

/// The known contacts as they stand at this time.
void Proxy::see(double time_s) noexcept {
  if (time_s == known_s_) return;
  Known seen;
  for (const auto& [contact, multiplier] : known_) seen.add({as_seen(contact, known_s_, time_s), multiplier});
  known_ = seen;
  known_s_ = time_s;
}

/// A contact of one time at another.
Contact Proxy::as_seen(const Contact& contact, double from_s, double to_s) const noexcept {
  if (!scene_.moves() || from_s == to_s) return contact;
  return moved(contact, scene_.motion(contact.obstacle, from_s, to_s));
}

/// As near to p as the contacts known allow, no farther than so much from the pose at hand.
Projection Proxy::step(const Pose& X_WP, double longest_m) noexcept {
  const ExactProjection::Leash leash = {longest_m,
                                        std::min(longest_m / scene_.tool_radius_m(), kLongestTurn_rad)};
  const Projection q =
      exact_.step(X_WP, X_WQ_, std::span<const ActiveContact>(known_.begin(), known_.end()), leash);
  iterations_ = static_cast<std::uint16_t>(iterations_ + q.iterations);
  return q;
}

/// How far a point of the tool may be moved from one pose to the other.
double Proxy::way_m(const Pose& from, const Pose& to) const noexcept {
  return (to.translation_m - from.translation_m).norm() +
         scene_.tool_radius_m() * from.rotation.angularDistance(to.rotation);
}

/// Looks along the way from the pose at hand; what it meets there becomes known.
Proxy::Way Proxy::look_along(const Pose& X_WT, double time_s) noexcept {
  ++looks_;
  budget_.visits -= std::min(budget_.visits, kVisitsPerLook);
  bool learned = false;
  ContactSet met;
  const double tolerance_m = exact_.gap_tolerance_m(X_WT) - kClearance_m;
  half_spaces_.add_violated(Frame(X_WT), tolerance_m, met);
  for (const Contact& contact : met) learned = learn(contact) || learned;
  if (scene_.meshes().empty()) return learned ? Way::met_contacts : Way::free;
  const MeshContacts::Findings found = meshes_.look(X_WT, kClearance_m, budget_, time_s);
  if (!found.complete) return found.late ? Way::late : Way::too_long;
  for (const Contact& contact : found.met) learned = learn(contact) || learned;
  if (learned) return Way::met_contacts;
  return found.overlaps || !found.met.empty() || !met.empty() ? Way::too_long : Way::free;
}

/// False where it was known, or there is no room. A contact that has less room already is held where it is:
/// the pose at hand must remain one of those allowed.
bool Proxy::learn(Contact contact) noexcept {
  for (const ActiveContact& known : known_)
    if (same_features(known.contact, contact)) return false;
  const double gap = gap_m(as_seen(contact, known_s_, seen_s_), X_WQ_);
  if (gap < kClearance_m) {
    const double lower_m = kClearance_m - std::max(gap, kLeastClearance * kClearance_m);
    contact.p_WB_m -= lower_m * normal_W(contact, X_WQ_);
    contact.offset_m -= lower_m;
  }
  return known_.add({contact, 0.0});
}

/// Keeps the contacts that touch at q and whose features lie opposite each other there. True where one that
/// carried is not among them.
bool Proxy::let_go(const Projection& q) noexcept {
  bool carried = false;
  known_.clear();
  for (const ActiveContact& active : q.active) {
    if (active.contact.obstacle < scene_.first_mesh() || meshes_.touching().contains(active.contact))
      known_.add(active);
    else
      carried = carried || active.multiplier > 0.0;
  }
  return carried;
}

/// q with what it is for p, whatever it was found for.
Projection Proxy::described(const Pose& X_WP, Projection q) const noexcept {
  q.iterations = iterations_;
  q.energy = q.status == ProjectionStatus::free ? 0.0 : energy(M_, X_WP, q.X_WQ);
  return q;
}

}  // namespace wrenchd
