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
class PredictiveCandidateList {
 public:
  /// So many pairs are sieved in the time of a visit.
  static constexpr std::size_t kPairsPerVisit = 32;

  /// The scene is kept by reference.
  explicit PredictiveCandidateList(const Scene& scene);
  PredictiveCandidateList(const PredictiveCandidateList&) =
      delete;  // a copy would lose the room that is kept
  PredictiveCandidateList& operator=(const PredictiveCandidateList&) = delete;

  /// Scene time at the start and at the end of a way; it matters where obstacles move.
  struct PathTimes {
    double start_s = 0.0, end_s = 0.0;
  };

  /// Sees to it that listed() holds for the straight way from one pose to the other. False where that would
  /// take more than what there is of the budget: the way is too long, or the list waits(). RT safe.
  bool ensure_covers(const Pose& X_start, const Pose& X_end, VisitBudget& budget) noexcept {
    return ensure_covers(X_start, X_end, PathTimes{}, budget);
  }
  bool ensure_covers(const Pose& X_start, const Pose& X_end, const PathTimes& times,
                     VisitBudget& budget) noexcept;

  /// Is the list that was asked for last being made, to be gone on with when it is asked for again?
  bool list_pending() const noexcept { return list_pending_; }
  /// The share of this way that listed() holds for, in a scene where nothing moves. RT safe.
  double covered_fraction(const Pose& X_start, const Pose& X_end) const noexcept {
    return covered_fraction_of(*current_, X_start, X_end);
  }
  /// What a list takes for every tick that it is made for, in visits; 0: none was made yet.
  double list_visits_per_tick() const noexcept { return current().node_visits() / horizon_ticks_; }

  /// Once a tick, when the tool has come to X_WT at this scene time, following a hand that has come to X_WP:
  /// goes on with the list for where it will be. to_spare: visits that may as well be spent on it, if it does
  /// not need as many. RT safe.
  void prefetch(const Pose& X_WT, const Pose& X_WP, VisitBudget& budget, double time_s = 0.0,
                std::uint32_t to_spare = 0) noexcept;

  /// The tool is elsewhere now: what was, says nothing about what will be. RT safe.
  void reset() noexcept;

  const CandidatePairs& current() const noexcept { return *current_; }
  PairCuller& culler() noexcept { return current_->culler(); }                 ///< of what is listed
  std::uint32_t immediate_lists() const noexcept { return immediate_lists_; }  ///< lists, so far

 private:
  bool defer() noexcept;
  bool next_list_is_cheaper(std::uint32_t most) const noexcept;
  bool build_immediately(const Pose& X_start, const Pose& X_end, const PathTimes& times,
                         VisitBudget& budget) noexcept;
  CandidatePairs::Path immediate_path(const Pose& X_start, const Pose& X_end, const PathTimes& times,
                                      double wait_ticks) const noexcept;
  double covered_fraction_of(const CandidatePairs& list, const Pose& X_start,
                             const Pose& X_end) const noexcept;
  CandidatePairs::Path predicted_path(double from_ticks, double to_ticks) const noexcept;
  bool within_prefetch_limits(const CandidatePairs::Path& way) const noexcept;
  bool next_list_unneeded(const Pose& X_WT, double soon, double time_s, bool to_spare) const noexcept;
  double valid_for_ticks(double most, double time_s) const noexcept;
  double service_ticks() const noexcept;
  double remaining_visits() const noexcept;
  std::uint32_t visits_this_tick(const Pose& X_soon, double soon) const noexcept;
  void adapt_horizon() noexcept;
  void make_current(CandidatePairs*& list) noexcept;

  const Scene& scene_;
  std::array<CandidatePairs, 3> lists_;
  CandidatePairs* current_ = &lists_[0];  ///< serves
  CandidatePairs* next_ = &lists_[1];     ///< is being made, or waits until it is needed
  CandidatePairs* spare_ = &lists_[2];    ///< for what must be listed at once
  bool mispredicted_ = false;  ///< the tool did not go in this tick where the list ahead was to serve
  bool list_pending_ = false,
       deferred_tick_ = false;  ///< the list asked for last, one asked for in this tick
  std::uint32_t immediate_lists_ = 0;

  MotionPredictor predictor_;
  double last_scene_time_s_ = 0.0,
         tick_duration_s_ = 0.0;             ///< scene time of the last tick, and how long it was
  std::uint32_t prefetch_cost_visits_ = 0;   ///< that the last one made ahead took
  std::uint32_t immediate_cost_visits_ = 0;  ///< that the last one made at once took
  double horizon_ticks_;                     ///< that the next is to serve
  double reach_scale_ = 1.0;                 ///< as a multiple of its reach where all goes as expected
};

}  // namespace wrenchd
