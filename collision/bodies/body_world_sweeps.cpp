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

/// Returns false if the contact is known or there is no room.
bool BodyWorld::add_contact(const BodyPair& pair, const Contact& contact) noexcept {
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
  added.stays = std::any_of(dropped_.begin(), dropped_.end(), [&](const BodyContact& dropped) {
    return dropped.a == added.a && dropped.b == added.b && same_features(dropped.contact, contact);
  });
  contacts_.push_back(added);
  unsolve(added.a);
  unsolve(added.b);
  return true;
}

/// Drops contacts that do not touch, and contacts whose features do not face each other. Returns true if one
/// of these carried: the poses are then solved again. If a sweep then finds the same contact once more, as at
/// the border of a face, the contact stays until the next step.
bool BodyWorld::drop_separated() noexcept {
  bool carried = false;
  std::erase_if(contacts_, [&](const BodyContact& c) {
    if (bodies_[c.a].asleep || c.stays) return false;
    const double gap_m = geometry(c).gap_m;
    const bool loaded = c.force_W_N.squaredNorm() > 0.0;
    if (gap_m > kTouch * kClearance_m) return !loaded;
    if (pair_of(c).touches(c.contact)) return false;
    if (!loaded) return true;
    carried = true;
    if (dropped_.size() < dropped_.capacity()) dropped_.push_back(c);
    unsolve(c.a);
    unsolve(c.b);
    return true;
  });
  return carried;
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
