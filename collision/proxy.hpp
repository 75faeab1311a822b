// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>

#include "collision/half_space_contacts.hpp"
#include "collision/mesh_contacts.hpp"
#include "collision/work_balancer.hpp"
#include "core/projection.hpp"

namespace wrenchd {

/// The admissible proxy (section 4 of the method): a configuration q that follows the hand's p through a
/// scene of any shape, never enters an obstacle and never passes through one.
///
/// Each step goes straight from an admissible pose towards the closest-point projection of p for the contacts
/// known. What the tool meets on that way becomes a contact, and the projection is sought again; a way on
/// which it meets nothing is gone. There, contacts whose features no longer lie opposite each other let go.
/// It ends where p is reached, or where all contacts that carry hold: q then is a local optimum of
/// min T(p, q), and T has only fallen on the way.
///
/// Obstacles that move push it first: it gives way by as little as it can, to the closest-point projection of
/// where it is itself, and follows the hand from there. Where they move too fast for the work of a tick, it
/// sees them late: q is admissible for where they stood at admissible_time_s().
///
/// However deep p is and however fast it moves, q is an admissible pose at any time, and the work is bounded:
/// when it is used up, q is as far as it came. Ticks are kept much alike: what would make one take several
/// times what most take, a list of pairs that has to be made at once above all, is spread over two or three,
/// which go as far as what is known to be free allows; and one that has little to do makes more ahead
/// (even_work.hpp). Where obstacles move nothing waits.
///
/// All memory is taken at construction. One object serves one thread.
class Proxy {
 public:
  /// What contacts are held open by [m]: far more than rounding, far less than anybody feels. Poses are
  /// admissible to whoever checks them.
  static constexpr double kClearance_m = 1e-9;

  /// Of one tick, counted in work and not in time, so that a replay does the same. A visit takes well below a
  /// tenth of a microsecond; a close fit of tens of thousands of triangles needs some ten thousand.
  struct WorkLimit {
    std::uint16_t sweeps = 24;          ///< ways looked along
    std::uint32_t node_visits = 40000;  ///< nodes and leaves of the trees, and what is found in them
    bool balanced = true;  ///< where a tick would take far more than most, leaves what can wait to the next
  };

  /// The scene is kept by reference and must outlive this.
  explicit Proxy(const Scene& scene) : Proxy(scene, WorkLimit{}) {}
  Proxy(const Scene& scene, WorkLimit effort);

  /// One tick: from X_last, last tick's q, towards p, among obstacles as they stand at time_s. The answer is
  /// infeasible where obstacles have moved into it from all sides. RT safe.
  Projection follow(const Pose& X_WP, const Pose& X_last, double time_s = 0.0) noexcept;

  /// One tick at which the tool is held at X_last, last tick's q, in a scene where nothing moves. RT safe.
  void hold(const Pose& X_last) noexcept;

  /// Forgets the contacts of the last tick. The next X_last was admissible at time_s. RT safe.
  void clear_history(double time_s = 0.0) noexcept;

  double admissible_time_s() const noexcept {
    return admissible_time_s_;
  }  ///< the scene time that q is admissible at

  std::uint16_t sweeps() const noexcept { return sweeps_; }  ///< of the last tick
  std::uint32_t node_visits() const noexcept {
    return work_limit_.node_visits - budget_.remaining;
  }  ///< likewise
  std::size_t candidate_count() const noexcept { return meshes_.candidate_count(); }

 private:
  using KnownContacts = StaticVector<ActiveContact, ContactSet::kCapacity>;
  enum class PathResult : std::uint8_t { free, contacts_found, path_too_long, list_pending };

  void set_budget(double hand_m) noexcept;
  void prefetch(const Pose& X_WT, const Pose& X_WP) noexcept;
  bool target_reached() const noexcept;
  Projection solve(const Pose& X_WP, double time_s) noexcept;
  bool yield_to_obstacles(double time_s) noexcept;
  void move_known_contacts(double time_s) noexcept;
  Contact contact_at(const Contact& contact, double from_s, double to_s) const noexcept;
  Projection step(const Pose& X_WP, double longest_m) noexcept;
  double displacement_bound_m(const Pose& from, const Pose& to) const noexcept;
  PathResult sweep_along(const Pose& X_WT, double time_s) noexcept;
  bool add_known_contact(Contact contact) noexcept;
  bool drop_separated_contacts(const Projection& q) noexcept;
  Projection unfinished_answer(const Pose& X_WP) const noexcept;
  Projection finish(const Pose& X_WP, Projection q) const noexcept;

  const Scene& scene_;
  WorkLimit work_limit_;
  Inertia M_;
  ExactProjection exact_;
  HalfSpaceContacts half_spaces_;
  MeshContacts meshes_;
  KnownContacts known_contacts_;
  std::optional<Pose> X_last_WP_;       ///< last tick's p
  Pose X_WQ_;                           ///< the admissible pose at hand
  double admissible_time_s_ = 0.0;      ///< the scene time that it is admissible at
  double known_contacts_time_s_ = 0.0;  ///< the scene time that the known contacts are of
  std::uint16_t trapped_ticks_ = 0;
  VisitBudget budget_;
  WorkBalancer balancer_;
  std::uint32_t min_remaining_visits_ = 0;  ///< of the budget of an even tick
  bool deferred_ = false;                   ///< this tick was to do more
  double first_step_fraction_ = 1.0;        ///< of the longest step, for the first of the next tick
  std::uint16_t sweeps_ = 0;
  std::uint16_t iterations_ = 0;
};

}  // namespace wrenchd
