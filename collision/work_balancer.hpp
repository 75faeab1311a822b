// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace wrenchd {

/// Balances work across ticks. Estimates the usual cost of sweep queries and of candidate-list construction,
/// and returns the work limit for the next tick. Work beyond the limit waits for the next tick, whose limit
/// may be higher. A tick below the target uses the rest to prefetch candidate pairs.
///
/// The unit is node visits (pairs/bvh_traversal.hpp), not time, so that a replay gives equal results. All
/// members are RT-safe.
class WorkBalancer {
 public:
  /// Updates the estimates; call it once per tick. sweep_visits: work of the tick's sweeps. list_visits: cost
  /// of the candidate list per tick in which it is used. deferred: true if the tick left necessary work for
  /// the next one. RT-safe.
  void update(std::uint32_t sweep_visits, double list_visits, bool deferred) noexcept;
  /// Discards all estimates, for example after the tool was placed elsewhere. RT-safe.
  void reset() noexcept { *this = WorkBalancer(); }

  /// Returns the usual work of the sweeps of one tick [node visits]. RT-safe.
  double typical_sweep_visits() const noexcept { return sweep_visits_; }
  /// Returns the work up to which a tick may prefetch [node visits]. With this target few ticks need twice as
  /// much. RT-safe.
  double target_visits() const noexcept;
  /// Returns the work limit of the next tick [node visits]. urgency: speed of the hand relative to a hand
  /// that tolerates deferral, at least 1. RT-safe.
  std::uint32_t max_visits(double urgency) const noexcept;

 private:
  double ticks_ = 0.0;                             ///< number of observed ticks
  double sweep_visits_ = 0.0, list_visits_ = 0.0;  ///< estimated cost per tick [node visits]
  double recent_deferrals_ = 0.0;                  ///< decaying count of recent ticks that deferred work
};

}  // namespace wrenchd
