// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace wrenchd {

/// How much work one tick may take for all to take much the same: by what looks took of late, and what the
/// lists of pairs take that they live on. What is left over waits for the next tick, which may take more
/// then. A tick that needs less than most is brought up to them with what is made ahead: what is early is
/// never late. Counted in visits (tree_walk.hpp), so that a replay does the same.
class EvenWork {
 public:
  /// Once a tick: what its looks took and, for every tick that it serves, the list they looked through. late:
  /// it left something over that it needed. RT safe.
  void learn(std::uint32_t looks, double list, bool late) noexcept;
  /// The tool is elsewhere now. RT safe.
  void forget() noexcept { *this = EvenWork(); }

  /// What looks take in most ticks. RT safe.
  double usual_of_looks() const noexcept { return looks_; }
  /// What every tick is brought up to, so that few need twice as much. RT safe.
  double even() const noexcept;
  /// What the next tick may take. haste: how many times faster the hand moves than one that can wait; at
  /// least 1. RT safe.
  std::uint32_t most(double haste) const noexcept;

 private:
  double learned_ = 0.0;             ///< ticks
  double looks_ = 0.0, list_ = 0.0;  ///< visits
  double lateness_ = 0.0;            ///< ticks that were late, of late
};

}  // namespace wrenchd
