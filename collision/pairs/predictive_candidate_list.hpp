// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "collision/pairs/candidate_pairs.hpp"
#include "collision/pairs/motion_predictor.hpp"
#include "collision/scene.hpp"

namespace wrenchd {

/// Lists of near pairs (near_pairs.hpp) for a tool that follows a hand: while one serves, the next is made
/// for where the tool will be then, a little with every tick. Only where the tool did not go there is a list
/// made at once.
///
/// Memory is taken at construction. One object serves one thread.
class PairsAhead {
 public:
  /// So many pairs are sieved in the time of a visit.
  static constexpr std::size_t kPairsPerVisit = 32;

  /// The scene is kept by reference.
  explicit PairsAhead(const Scene& scene);
  PairsAhead(const PairsAhead&) = delete;  // a copy would lose the room that is kept
  PairsAhead& operator=(const PairsAhead&) = delete;

  /// Scene time at the start and at the end of a way; it matters where obstacles move.
  struct Times {
    double start_s = 0.0, end_s = 0.0;
  };

  /// Sees to it that listed() holds for the straight way from one pose to the other. False where that would
  /// take more than what there is of the budget: the way is too long, or the list waits(). RT safe.
  bool list(const Pose& X_start, const Pose& X_end, WalkBudget& budget) noexcept {
    return list(X_start, X_end, Times{}, budget);
  }
  bool list(const Pose& X_start, const Pose& X_end, const Times& times, WalkBudget& budget) noexcept;

  /// Is the list that was asked for last being made, to be gone on with when it is asked for again?
  bool waits() const noexcept { return late_; }
  /// The share of this way that listed() holds for, in a scene where nothing moves. RT safe.
  double share_listed(const Pose& X_start, const Pose& X_end) const noexcept {
    return share_of(*listed_, X_start, X_end);
  }
  /// What a list takes for every tick that it is made for, in visits; 0: none was made yet.
  double visits_per_tick() const noexcept { return listed().visits() / ticks_ahead_; }

  /// Once a tick, when the tool has come to X_WT at this scene time, following a hand that has come to X_WP:
  /// goes on with the list for where it will be. to_spare: visits that may as well be spent on it, if it does
  /// not need as many. RT safe.
  void look_ahead(const Pose& X_WT, const Pose& X_WP, WalkBudget& budget, double time_s = 0.0,
                  std::uint32_t to_spare = 0) noexcept;

  /// The tool is elsewhere now: what was, says nothing about what will be. RT safe.
  void forget() noexcept;

  const NearPairs& listed() const noexcept { return *listed_; }
  PairSieve& sieve() noexcept { return listed_->sieve(); }               ///< of what is listed
  std::uint32_t made_at_once() const noexcept { return made_at_once_; }  ///< lists, so far

 private:
  bool late() noexcept;
  bool is_sooner_made(std::uint32_t most) const noexcept;
  bool list_at_once(const Pose& X_start, const Pose& X_end, const Times& times, WalkBudget& budget) noexcept;
  NearPairs::Way way_at_once(const Pose& X_start, const Pose& X_end, const Times& times,
                             double wait_ticks) const noexcept;
  double share_of(const NearPairs& list, const Pose& X_start, const Pose& X_end) const noexcept;
  NearPairs::Way way_ahead(double from_ticks, double to_ticks) const noexcept;
  bool goes_slowly(const NearPairs::Way& way) const noexcept;
  bool provided(const Pose& X_WT, double soon, double time_s, bool to_spare) const noexcept;
  double holds_for_ticks(double most, double time_s) const noexcept;
  double ticks_to_serve() const noexcept;
  double to_do() const noexcept;
  std::uint32_t portion(const Pose& X_soon, double soon) const noexcept;
  void weigh() noexcept;
  void serve(NearPairs*& list) noexcept;

  const Scene& scene_;
  std::array<NearPairs, 3> lists_;
  NearPairs* listed_ = &lists_[0];  ///< serves
  NearPairs* ahead_ = &lists_[1];   ///< is being made, or waits until it is needed
  NearPairs* spare_ = &lists_[2];   ///< for what must be listed at once
  bool astray_ = false;             ///< the tool did not go in this tick where the list ahead was to serve
  bool late_ = false, late_tick_ = false;  ///< the list asked for last, one asked for in this tick
  std::uint32_t made_at_once_ = 0;

  ExpectedMotion motion_;
  double last_s_ = 0.0, tick_s_ = 0.0;  ///< scene time of the last tick, and how long it was
  std::uint32_t visits_of_list_ = 0;    ///< that the last one made ahead took
  std::uint32_t visits_at_once_ = 0;    ///< that the last one made at once took
  double ticks_ahead_;                  ///< that the next is to serve
  double unsure_ = 1.0;                 ///< as a multiple of its reach where all goes as expected
};

}  // namespace wrenchd
