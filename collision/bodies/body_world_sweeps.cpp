// SPDX-License-Identifier: GPL-3.0-or-later
// Which contacts a BodyWorld has: the sweeps of its pairs, core/METHOD.md, section 15.4.
#include <algorithm>
#include <cmath>

#include "collision/bodies/body_world.hpp"

namespace wrenchd {
namespace {

/// Gap at which a sweep ignores the contacts that are held open, as a multiple of the clearance.
constexpr double kBehind = 0.1;
/// If a sweep finds an overlap but no contact, the contacts with a gap below this multiple of the clearance
/// at the start are added.
constexpr double kNearby = 4.0;
/// A path that is too long falls to this fraction.
constexpr double kShorter = 0.25;
constexpr double kMinFraction = 1.0 / 256.0;
/// Length of the first part of a path that is swept [m]. The next parts are longer by this factor.
constexpr double kFirstPart_m = 5e-4, kLonger = 4.0;
/// Least first part, as a fraction of the path. Limits the number of parts to four.
constexpr double kLeastPart = 1.0 / 1024.0;
/// Tolerance of the distance between an expired contact and those that continue it [m].
constexpr double kSuccessor_m = 1e-6;

}  // namespace

BodyPath BodyWorld::path_of(std::size_t body) const noexcept {
  if (body == BodyContact::kFixed) return {};
  return {bodies_[body].motion.X_WB, bodies_[body].X_WQ};
}

bool BodyWorld::takes_part(std::size_t body) const noexcept {
  return body == BodyContact::kFixed || bodies_[body].weight_per_s2 > 0.0;
}

/// Sweeps the pairs with a body whose end pose changed since the last sweeps. Returns true if all paths are
/// free.
bool BodyWorld::sweep_pairs() noexcept {
  bool free = true;
  for (const auto& pair : pairs_) {
    const auto changed = [&](std::size_t i) {
      return i != BodyContact::kFixed && !same_bits(bodies_[i].X_WQ, bodies_[i].X_WQ_swept);
    };
    if (!takes_part(pair->a()) || !takes_part(pair->b()) || joins(*pair)) continue;
    if (is_shortened(pair->a()) || is_shortened(pair->b())) continue;
    const bool moves = pair->is_fixed() && pair->scene().has_moving_obstacles();
    if (!moves && !changed(pair->a()) && !changed(pair->b())) continue;
    if (!sweep_pair(*pair)) free = false;
  }
  if (free)
    for (Body& body : bodies_) body.X_WQ_swept = body.X_WQ;
  return free;
}

bool BodyWorld::sweep_pair(BodyPair& pair) noexcept {
  bool free = true;
  if (pair.is_fixed() && !pair.scene().half_spaces().empty()) {
    ContactSet met;
    for (const BodyContact& c : contacts_)
      if (c.a == pair.a() && c.b == BodyContact::kFixed) met.add(c.contact);
    const std::size_t known = met.size();
    pair.add_half_spaces(bodies_[pair.a()].X_WQ, 0.5 * kClearance_m, met);
    for (std::size_t k = known; k < met.size(); ++k) free = !add_contact(pair, met[k]) && free;
  }
  if (!pair.is_near(path_of(pair.a()), path_of(pair.b()))) return free;
  if (meets_soon(pair)) return false;
  const SweepQuery::SweepResult found = sweep(pair, kClearance_m);
  bool found_new = false;
  for (const Contact& contact : found.contacts) found_new = add_contact(pair, contact) || found_new;
  if (found_new) return false;
  if (found.complete && !found.overlaps) {
    if (found.contacts.empty()) return free;
    if (held_open(pair, found)) return !add_behind(pair) && free;
  }
  if (!add_touching(pair)) shorten(pair);
  return false;
}

/// Sweeps the paths of a pair.
SweepQuery::SweepResult BodyWorld::sweep(BodyPair& pair, double clearance_m) noexcept {
  return pair.sweep(path_of(pair.a()), path_of(pair.b()), clearance_m, budget_, {time_s_, until_s_});
}

/// Sweeps the first part of a long path, then longer ones, because most paths meet something soon. Adds what
/// the first of them meets that is not known, and returns true if there is such a contact. Contacts with
/// obstacles that move are those at the end of the step, so with these only the whole path counts.
bool BodyWorld::meets_soon(BodyPair& pair) noexcept {
  if (pair.scene().has_moving_obstacles()) return false;
  const BodyPath path_a = path_of(pair.a()), path_b = path_of(pair.b());
  double length_m = displacement_bound_m(path_a, bodies_[pair.a()].radius_m);
  if (!pair.is_fixed()) length_m += displacement_bound_m(path_b, bodies_[pair.b()].radius_m);
  for (double part = std::max(kFirstPart_m / length_m, kLeastPart); part * kLonger < 1.0; part *= kLonger) {
    const auto first_part = [part](const BodyPath& path) {
      return BodyPath{path.start, between(path.start, path.end, part)};
    };
    const SweepQuery::SweepResult found =
        pair.sweep(first_part(path_a), first_part(path_b), kClearance_m, budget_, {time_s_, until_s_});
    bool found_new = false;
    for (const Contact& contact : found.contacts) found_new = add_contact(pair, contact) || found_new;
    if (found_new) return true;
  }
  return false;
}

/// Adds contacts that a sweep did not name because the path meets known ones first. These are held open, but
/// at less than the clearance. Returns true if there are such contacts.
bool BodyWorld::add_behind(BodyPair& pair) noexcept {
  const SweepQuery::SweepResult behind = sweep(pair, kBehind * kClearance_m);
  bool found_new = false;
  for (const Contact& contact : behind.contacts) found_new = add_contact(pair, contact) || found_new;
  if (found_new) return true;
  if (behind.complete && !behind.overlaps && behind.contacts.empty()) {
    sweep(pair, kClearance_m);  // for touches()
    return false;
  }
  shorten(pair);
  return true;
}

/// Adds the contacts that touch at the start. A sweep that finds no contact although its end overlaps may
/// lack one that was dropped at the border of its features. Returns false if all are known.
bool BodyWorld::add_touching(BodyPair& pair) noexcept {
  if (pair.scene().has_moving_obstacles()) return false;  // their contacts are those of the end of the step
  const auto start_of = [&](std::size_t i) {
    return i == BodyContact::kFixed ? BodyPath{} : BodyPath{bodies_[i].motion.X_WB, bodies_[i].motion.X_WB};
  };
  pair.sweep(start_of(pair.a()), start_of(pair.b()), kNearby * kClearance_m, budget_, {time_s_, time_s_});
  bool found_new = false;
  for (const Contact& contact : pair.touching()) found_new = add_contact(pair, contact) || found_new;
  return found_new;
}

/// True if the known contacts keep open what a sweep found: a gap just below the clearance is no crossing.
bool BodyWorld::held_open(const BodyPair& pair, const SweepQuery::SweepResult& found) const noexcept {
  return std::all_of(found.contacts.begin(), found.contacts.end(), [&](const Contact& contact) {
    return std::any_of(contacts_.begin(), contacts_.end(), [&](const BodyContact& known) {
      return known.a == pair.a() && known.b == pair.b() && same_features(known.contact, contact) &&
             geometry(known).gap_m >= kMinClearance * kClearance_m;
    });
  });
}

void BodyWorld::unsolve(std::size_t body) noexcept {
  if (body == BodyContact::kFixed) return;
  if (bodies_[body].asleep) wake(body);
  bodies_[body].solved = false;
  bodies_[body].touches = true;
}

/// The next shorter fraction of a path; 0 after the shortest.
double BodyWorld::shorter(double fraction) noexcept {
  return fraction > kMinFraction ? kShorter * fraction : 0.0;
}

/// Lets the bodies of a pair try a shorter way.
void BodyWorld::shorten(const BodyPair& pair) noexcept {
  for (const std::size_t i : {pair.a(), pair.b()}) {
    if (i == BodyContact::kFixed) continue;
    const std::size_t island = bodies_[i].island;
    for (Body& body : bodies_) {
      if (body.island != island) continue;
      body.fraction = shorter(body.fraction);
      body.solved = false;
      body.shortened = true;
    }
  }
}

/// Adds a contact that the answer must keep open. Returns false if it is known or there is no room.
bool BodyWorld::add_contact(const BodyPair& pair, const Contact& contact) noexcept {
  if (!store_contact(pair, contact)) return false;
  unsolve(pair.a());
  unsolve(pair.b());
  return true;
}

/// Adds a contact to the known ones. Returns false if it is among them or there is no room.
bool BodyWorld::store_contact(const BodyPair& pair, const Contact& contact) noexcept {
  if (contacts_.size() == kMaxContacts) return false;
  BodyContact added;
  added.a = pair.a();
  added.b = pair.b();
  added.contact = contact;
  for (const BodyContact& known : contacts_)
    if (known.a == added.a && known.b == added.b && same_features(known.contact, contact)) return false;
  const Body& a = bodies_[added.a];
  added.mu = pair.is_fixed() ? a.friction : std::sqrt(a.friction * bodies_[added.b].friction);
  added.restitution = pair.is_fixed() ? a.restitution : std::max(a.restitution, bodies_[added.b].restitution);
  if (pair.is_fixed() && pair.scene().has_moving_obstacles())
    added.obstacle_motion = pair.scene().obstacle_displacement(contact.obstacle, time_s_, until_s_);
  added.hold_m = held_gap_m(added, 0.0);
  contacts_.push_back(added);
  return true;
}

/// Drops contacts that do not touch. A contact that carries although its features do not face each other, as
/// just beyond the border of a face, expires, and its successors become known: core/METHOD.md, section 15.4.
void BodyWorld::drop_separated() noexcept {
  const auto carries = [](const BodyContact& c) { return c.force_W_N.squaredNorm() > 0.0; };
  const auto is_open = [&](const BodyContact& c) { return geometry(c).gap_m > kTouch * kClearance_m; };
  const auto faces = [&](const BodyContact& c) { return pair_of(c).touches(c.contact); };
  std::erase_if(contacts_, [&](const BodyContact& c) {
    return !bodies_[c.a].asleep && !carries(c) && (is_open(c) || !faces(c));
  });
  for (BodyContact& c : contacts_)
    if (!bodies_[c.a].asleep) c.expired = carries(c) && !is_open(c) && !faces(c);
  const std::size_t count = contacts_.size();
  for (std::size_t k = 0; k < count; ++k)
    if (contacts_[k].expired && !bodies_[contacts_[k].a].asleep) add_successors(contacts_[k]);
}

/// Adds the contacts that continue an expired one: those that touch no farther from it than it slipped.
void BodyWorld::add_successors(const BodyContact& expired) noexcept {
  BodyContact next = expired;
  const Vector3d point_W_m = geometry(expired).point_W_m;
  const double reach_m = slip_m(expired, acting_geometry(expired)).norm() + kSuccessor_m;
  const BodyPair& pair = pair_of(expired);
  for (const Contact& contact : pair.touching()) {
    next.contact = contact;
    if ((geometry(next).point_W_m - point_W_m).norm() <= reach_m) store_contact(pair, contact);
  }
}

/// Prepares the sweeps of the next step, for the motions that the bodies would have without contact.
void BodyWorld::prefetch() noexcept {
  for (Body& body : bodies_) {
    body.next = {body.motion.X_WB, body.motion.X_WB};
    if (body.asleep) continue;
    body.next.end =
        body.tool != kNoTool ? body.X_goal : moved_freely(body.M, body.motion, body.forces, dt_s_).X_WB;
  }
  const auto still = [&](std::size_t i) { return i == BodyContact::kFixed || bodies_[i].asleep; };
  const auto next = [&](std::size_t i) { return i == BodyContact::kFixed ? BodyPath{} : bodies_[i].next; };
  for (const auto& pair : pairs_) {
    if (!takes_part(pair->a()) || !takes_part(pair->b()) || joins(*pair)) continue;
    if (still(pair->a()) && still(pair->b()) && !pair->scene().has_moving_obstacles()) continue;
    const BodyPath path_a = next(pair->a()), path_b = next(pair->b());
    if (pair->is_near(path_a, path_b)) pair->prefetch(path_a, path_b, time_s_, budget_);
  }
}

}  // namespace wrenchd
