// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "collision/half_space_contacts.hpp"
#include "collision/scene.hpp"
#include "collision/sweep_query.hpp"
#include "collision/work_balancer.hpp"
#include "core/contact_backend.hpp"
#include "core/projection.hpp"

namespace wrenchd {

/// The admissible proxy: a configuration q that follows the commanded pose p through a scene of any shape. It
/// never enters an obstacle and never passes through one (core/METHOD.md, section 14; collision/README.md,
/// "The proxy").
///
/// One tick alternates projections and sweeps. The projection yields the pose closest to p that the known
/// contacts admit. The sweep along the straight path to that pose adds the contacts that the tool meets. The
/// tick ends if q = p, if all loaded contacts hold (q is a local optimum of min T(p, q)), or if the work
/// limit is reached. T never increases within a tick unless obstacles move.
///
/// Obstacles that move displace the proxy first, by the smallest possible amount. If they are too fast for
/// the work of one tick, q is admissible for their poses at admissible_time_s(). The work balancer
/// (work_balancer.hpp) keeps the work of all ticks similar. Where obstacles move, no work is deferred.
///
/// The constructor allocates all memory. One object serves one thread. All members but the constructor are
/// RT-safe, unless CGAL detects the contacts (ContactBackend::cgal): then a tick allocates, no work is
/// deferred, and only the limit of sweeps applies.
class Proxy {
 public:
  /// The gap at which contacts are held open [m]. It is far above rounding errors and far below human
  /// perception, so every check finds the pose admissible.
  static constexpr double kClearance_m = 1e-9;

  /// Work limit of one tick. The limit counts work, not time, so that a replay gives equal results. A node
  /// visit takes well below 0.1 us. A tight fit of tens of thousands of triangles needs about 10,000 node
  /// visits.
  struct WorkLimit {
    std::uint16_t sweeps = 24;          ///< maximum number of sweeps
    std::uint32_t node_visits = 40000;  ///< maximum number of node visits, pair tests included
    bool balanced = true;  ///< if true, the balancer defers work of ticks that cost far more than most
  };

  /// Keeps a reference to the scene, which must outlive this object. Not RT-safe: allocates.
  explicit Proxy(const Scene& scene, ContactBackend contacts = ContactBackend::native)
      : Proxy(scene, WorkLimit{}, contacts) {}
  Proxy(const Scene& scene, WorkLimit effort, ContactBackend contacts = ContactBackend::native);

  /// Computes one tick: moves from X_last, the q of the previous tick, towards p. time_s: scene time of the
  /// obstacle poses [s]. The status is infeasible if moving obstacles have trapped the tool. RT-safe.
  Projection follow(const Pose& X_WP, const Pose& X_last, double time_s = 0.0) noexcept;

  /// Computes one tick in which the tool stays at X_last, the q of the previous tick. Precondition: no
  /// obstacle moves. RT-safe.
  void hold(const Pose& X_last) noexcept;

  /// Clears the contacts of the last tick. The next X_last must be admissible at time_s [s]. RT-safe.
  void clear_history(double time_s = 0.0) noexcept;

  /// Discards the known contacts: the next X_last is admissible, but not the answer of the last follow().
  /// RT-safe.
  void discard_contacts() noexcept { known_contacts_.clear(); }

  double admissible_time_s() const noexcept {
    return admissible_time_s_;
  }  ///< scene time at which q is admissible [s]

  std::uint16_t sweeps() const noexcept { return sweeps_; }  ///< number of sweeps of the last tick
  std::uint32_t node_visits() const noexcept {
    return work_limit_.node_visits - budget_.remaining;
  }  ///< node visits of the last tick
  std::size_t candidate_count() const noexcept { return meshes_->candidate_count(); }

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
  Projection held_answer(const Pose& X_WP) noexcept;
  Projection unfinished_answer(const Pose& X_WP) noexcept;
  Projection finish(const Pose& X_WP, Projection q) const noexcept;

  const Scene& scene_;
  WorkLimit work_limit_;
  Inertia M_;
  ExactProjection exact_;
  HalfSpaceContacts half_spaces_;
  std::unique_ptr<SweepQuery> meshes_;
  KnownContacts known_contacts_;
  std::optional<Pose> X_last_WP_;       ///< p of the previous tick
  Pose X_WQ_;                           ///< the present admissible pose
  double admissible_time_s_ = 0.0;      ///< scene time at which X_WQ_ is admissible [s]
  double known_contacts_time_s_ = 0.0;  ///< scene time of the obstacle poses in known_contacts_ [s]
  std::uint16_t trapped_ticks_ = 0;
  VisitBudget budget_;
  WorkBalancer balancer_;
  std::uint32_t min_remaining_visits_ = 0;  ///< remaining budget at which a balanced tick ends [node visits]
  bool deferred_ = false;                   ///< this tick leaves work for the next one
  /// length of the next tick's first step, as a fraction of the longest step
  double first_step_fraction_ = 1.0;
  std::uint16_t sweeps_ = 0;
  std::uint16_t iterations_ = 0;
};

}  // namespace wrenchd
