// SPDX-License-Identifier: GPL-3.0-or-later
// The poses of the bodies of a BodyWorld for known contacts, island by island: core/METHOD.md, section 15.8.
#include <algorithm>
#include <cmath>

#include "collision/bodies/body_world.hpp"

namespace wrenchd {
namespace {

/// Most Newton steps of an island with Coulomb's friction, METHOD (106), and then most without friction.
constexpr int kNewtonSteps = 12;
/// Most Newton steps of an island if the work limit of the solver is reached.
constexpr int kLateSteps = 9;
/// A solve that did not converge is accepted if its last Newton step moved no point farther than this [m].
constexpr double kAccepted_m = 1e-7;
/// An acceptable solve ends if its steps fall by less than this factor.
constexpr double kStalled = 0.5;
}  // namespace

std::size_t BodyWorld::root_of(std::size_t body) noexcept {
  while (bodies_[body].island != body) body = bodies_[body].island = bodies_[bodies_[body].island].island;
  return body;
}

/// Bodies that a chain of contacts connects are one island.
void BodyWorld::find_islands() noexcept {
  for (std::size_t i = 0; i < bodies_.size(); ++i) bodies_[i].island = i;
  for (const BodyContact& c : contacts_)
    if (c.b != BodyContact::kFixed) bodies_[root_of(c.b)].island = root_of(c.a);
  for (std::size_t i = 0; i < bodies_.size(); ++i)
    if (is_held(i)) bodies_[root_of(i)].island = root_of(bodies_[i].mover);
  for (std::size_t i = 0; i < bodies_.size(); ++i) bodies_[i].island = root_of(i);
}

/// Solves the islands with a body whose contacts changed.
void BodyWorld::solve_islands() noexcept {
  find_islands();
  for (std::size_t island = 0; island < bodies_.size(); ++island) {
    if (bodies_[island].island != island) continue;
    bool solved = true;
    double fraction = 1.0;  // the same time passes for all bodies of an island
    for (const Body& body : bodies_) {
      if (body.island != island) continue;
      solved = solved && body.solved;
      fraction = std::min(fraction, body.fraction);
    }
    if (solved) continue;
    for (;;) {
      for (Body& body : bodies_) {
        if (body.island != island || body.weight_per_s2 == 0.0) continue;
        body.fraction = fraction;
        set_goal(body);
      }
      if (solve_island(island)) break;
      fraction = shorter(fraction);
    }
  }
}

/// Solves an island. Returns false if Newton's method does not converge: the tick is then too long.
bool BodyWorld::solve_island(std::size_t island) noexcept {
  island_bodies_.clear();
  island_contacts_.clear();
  bool holding = false;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    if (bodies_[i].island != island || bodies_[i].weight_per_s2 == 0.0) continue;
    bodies_[i].solved = true;
    if (is_held(i)) {
      holding = true;
      continue;
    }
    bodies_[i].block = island_bodies_.size();
    island_bodies_.push_back(i);
  }
  for (std::size_t k = 0; k < contacts_.size(); ++k)
    if (bodies_[contacts_[k].a].island == island) island_contacts_.push_back(k);
  if (bodies_[island].fraction == 0.0) {
    for (const std::size_t k : island_contacts_) contacts_[k].force_W_N.setZero();
    for (Body& body : bodies_)
      if (body.island == island && body.weight_per_s2 > 0.0) hold(body);
    return true;
  }
  if (island_contacts_.empty() && !holding) {
    for (const std::size_t i : island_bodies_) bodies_[i].X_WQ = bodies_[i].X_goal;
    return true;
  }
  if (converge(island, Friction::coulomb) || converge(island, Friction::none)) return true;
  for (Body& body : bodies_)
    if (body.island == island && body.weight_per_s2 > 0.0) body.X_WQ = body.motion.X_WB;
  return false;
}

/// Newton's method for an island. Coulomb's law gives way to cones with the lifts that they have where it has
/// no answer. Returns false if there is no admissible answer.
bool BodyWorld::converge(std::size_t island, Friction friction) noexcept {
  for (const std::size_t i : island_bodies_) bodies_[i].newton_step.setZero();
  bool extrapolated = false;
  for (int k = 0;; ++k) {
    const bool in_time = friction == Friction::none || solver_steps_ < settings_.solver_steps;
    if (!in_time) friction = Friction::frozen;
    const double change_before_m = last_change_m_;
    if (newton_step(friction)) break;
    if (friction == Friction::coulomb && cones_status_ == ConeProjection::Status::budget_spent)
      friction = Friction::frozen;
    const bool stalls = k > 0 && last_change_m_ > kStalled * change_before_m;
    if (last_change_m_ <= kAccepted_m && stalls && admissible(island)) break;
    if (k + 1 >= (in_time ? kNewtonSteps : kLateSteps)) break;
    extrapolated = k > 0 && !extrapolated && extrapolate();
  }
  return last_change_m_ <= kAccepted_m && admissible(island);
}

/// True if the present poses of an island keep all its known contacts open.
bool BodyWorld::admissible(std::size_t island) const noexcept {
  return std::all_of(contacts_.begin(), contacts_.end(), [&](const BodyContact& c) {
    return bodies_[c.a].island != island || geometry(c).gap_m >= kMinClearance * kClearance_m;
  });
}

}  // namespace wrenchd
