// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "collision/pairs/bvh_traversal.hpp"
#include "core/contact.hpp"
#include "core/pose.hpp"
#include "core/static_vector.hpp"

namespace wrenchd {

/// Sweep queries: finds the contacts that the tool's surface meets on the straight path from one pose to
/// another. collision/README.md ("The sweep") and core/METHOD.md, section 14.3, define them.
/// contact_detection.hpp makes the query of a backend.
///
/// One object serves one thread. A derived class states whether its members are RT-safe.
class SweepQuery {
 public:
  static constexpr std::size_t kMaxContacts = 12;

  struct SweepResult {
    /// The contacts met, in the order along the path. The list may be incomplete, but it is never empty if
    /// the tool meets a contact.
    StaticVector<Contact, kMaxContacts> contacts;
    /// True if the end pose overlaps an obstacle and no crossing was found on the path. The path is then too
    /// long. Only end poses of paths with large rotation are always tested.
    bool overlaps = false;
    /// False if the path needs more work than the budget allows. The other members are then undefined.
    bool complete = true;
    /// True if `complete` is false because a candidate list is still under construction.
    bool list_pending = false;
  };

  SweepQuery() = default;
  SweepQuery(const SweepQuery&) = delete;
  SweepQuery& operator=(const SweepQuery&) = delete;
  virtual ~SweepQuery() = default;

  /// Sets the start of the next sweeps: a pose that is admissible at scene time time_s [s].
  virtual void set_start(const Pose& X_WT, double time_s = 0.0) noexcept = 0;

  /// Sweeps the path from the start to X_WT while the obstacles move to their poses at time_s [s]. Contacts
  /// are held open by clearance_m [m]. The result states the contacts for the obstacle poses at time_s.
  /// Reduces `budget` by the work done.
  virtual SweepResult sweep(const Pose& X_WT, double clearance_m, VisitBudget& budget,
                            double time_s = 0.0) noexcept = 0;

  /// Prepares the sweeps of the next tick. Call it once per tick with the tool pose X_WT and the commanded
  /// pose X_WP. spare_visits: node visits that the preparation may use even if it does not need them yet.
  virtual void prefetch(const Pose& X_WT, const Pose& X_WP, VisitBudget& budget, double time_s = 0.0,
                        std::uint32_t spare_visits = 0) noexcept = 0;

  /// Returns the fraction [0, 1] of the path from the start to X_WT that a sweep within the budget covers.
  /// Precondition: no obstacle moves.
  virtual double covered_fraction(const Pose& X_WT) const noexcept = 0;
  /// Returns the cost of a candidate list per tick in which it is used [node visits]; 0 without lists.
  virtual double list_visits_per_tick() const noexcept = 0;
  /// Returns the work of this tick's sweeps without candidate lists [node visits].
  virtual std::uint32_t sweep_visits() const noexcept = 0;

  /// Discards what was prepared, for example after the tool was placed elsewhere.
  virtual void reset() noexcept = 0;

  /// The contacts whose gap at the end pose of the last sweep is at most the clearance, plus rounding.
  virtual const ContactSet& touching() const noexcept = 0;

  /// Number of pairs of triangles that the last sweep considered. 0: no obstacle is near.
  virtual std::size_t candidate_count() const noexcept = 0;
};

}  // namespace wrenchd
