// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace wrenchd {

/// How much work one tick may take for all to take much the same: by what looks took of late, and what the
/// lists of pairs take that they live on. What is left over waits for the next tick, which may take more
/// then. A tick that needs less than most is brought up to them with what is made ahead: what is early is
/// never late. Counted in visits (tree_walk.hpp), so that a replay does the same.
class WorkBalancer {
 public:
  /// Once a tick: what its looks took and, for every tick that it serves, the list they looked through. late:
  /// it left something over that it needed. RT safe.
  void update(std::uint32_t looks, double list, bool late) noexcept;
  /// The tool is elsewhere now. RT safe.
  void reset() noexcept { *this = WorkBalancer(); }

  /// What looks take in most ticks. RT safe.
  double typical_sweep_visits() const noexcept { return sweep_visits_; }
  /// What every tick is brought up to, so that few need twice as much. RT safe.
  double target_visits() const noexcept;
  /// What the next tick may take. haste: how many times faster the hand moves than one that can wait; at
  /// least 1. RT safe.
  std::uint32_t max_visits(double haste) const noexcept;

 private:
  double ticks_ = 0.0;                             ///< ticks
  double sweep_visits_ = 0.0, list_visits_ = 0.0;  ///< visits
  double recent_deferrals_ = 0.0;                  ///< ticks that were late, of late
};

}  // namespace wrenchd
