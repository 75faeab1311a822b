// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "collision/pairs/candidate_pairs.hpp"
#include "collision/pairs/motion_predictor.hpp"
#include "collision/scene.hpp"

namespace wrenchd {

/// Candidate lists (candidate_pairs.hpp) for a tool that follows a hand. While one list is in use, the next
/// one is prefetched for the predicted path, a part in each tick. If the tool leaves the predicted path, a
/// list for the actual path is built immediately.
///
/// The constructor allocates all memory. One object serves one thread. All members but the constructor are
/// RT-safe.
class PredictiveCandidateList {
 public:
  /// Number of pairs that the culler tests in the time of one node visit.
  static constexpr std::size_t kPairsPerVisit = 32;

  /// Keeps a reference to the scene, which must outlive this object. motion_is_continuous: the starts of all
  /// paths are admissible, and the tool goes from one to the next without passing through a surface, unless
  /// reset() or tool_was_placed() is called in between. False: a path may start anywhere. Not RT-safe:
  /// allocates.
  explicit PredictiveCandidateList(const Scene& scene, bool motion_is_continuous = false);
  PredictiveCandidateList(const PredictiveCandidateList&) = delete;  // a copy would lose the reserved memory
  PredictiveCandidateList& operator=(const PredictiveCandidateList&) = delete;

  /// Scene times at the start and at the end of a path [s]; used if obstacles move.
  struct PathTimes {
    double start_s = 0.0, end_s = 0.0;
  };

  /// Ensures that current() covers the straight path between two poses. Returns false if the budget does not
  /// suffice: the path is too long, or the list is under construction (list_pending()). RT-safe.
  bool ensure_covers(const Pose& X_start, const Pose& X_end, VisitBudget& budget) noexcept {
    return ensure_covers(X_start, X_end, PathTimes{}, budget);
  }
  bool ensure_covers(const Pose& X_start, const Pose& X_end, const PathTimes& times,
                     VisitBudget& budget) noexcept;

  /// True if the list requested last is under construction. The next ensure_covers() continues it.
  bool list_pending() const noexcept { return list_pending_; }
  /// Returns the fraction [0, 1] of the path that current() covers. Precondition: no obstacle moves. RT-safe.
  double covered_fraction(const Pose& X_start, const Pose& X_end) const noexcept {
    return covered_fraction_of(*current_, X_start, X_end);
  }
  /// Returns the cost of a list per tick in which it is used [node visits]; 0 before the first list. RT-safe.
  double list_visits_per_tick() const noexcept { return current().node_visits() / horizon_ticks_; }

  /// Continues the list for the predicted path. Call it once per tick with the tool pose X_WT, the commanded
  /// pose X_WP and the scene time [s]. spare_visits: node visits that the prefetch may use even if it does
  /// not need them yet. RT-safe.
  void prefetch(const Pose& X_WT, const Pose& X_WP, VisitBudget& budget, double time_s = 0.0,
                std::uint32_t spare_visits = 0) noexcept;

  /// Discards all lists and predictions, for example after the tool was placed elsewhere. RT-safe.
  void reset() noexcept;

  /// Discards lists that depend on the side of a surface on which the tool is (surface_sides.hpp): it is at
  /// an admissible pose now that it did not reach by a path on which it met nothing. RT-safe.
  void tool_was_placed() noexcept {
    if (sides_.any_known()) reset();
  }

  /// Returns the sides from which the tool can meet an obstacle of current(). number: index in
  /// scene.meshes(). RT-safe.
  unsigned sides_of(std::uint32_t number) noexcept { return sides_.of(number); }

  const CandidatePairs& current() const noexcept { return *current_; }
  PairCuller& culler() noexcept { return current_->culler(); }  ///< culler of current()
  /// number of lists built immediately so far
  std::uint32_t immediate_lists() const noexcept { return immediate_lists_; }

 private:
  bool defer() noexcept;
  bool next_list_is_cheaper(std::uint32_t max_visits) const noexcept;
  bool build_immediately(const Pose& X_start, const Pose& X_end, const PathTimes& times,
                         VisitBudget& budget) noexcept;
  CandidatePairs::Path immediate_path(const Pose& X_start, const Pose& X_end, const PathTimes& times,
                                      double delay_ticks) const noexcept;
  double covered_fraction_of(const CandidatePairs& list, const Pose& X_start,
                             const Pose& X_end) const noexcept;
  CandidatePairs::Path predicted_path(double from_ticks, double to_ticks) const noexcept;
  bool within_prefetch_limits(const CandidatePairs::Path& path) const noexcept;
  bool next_list_unneeded(const Pose& X_WT, double service, double time_s,
                          bool has_spare_work) const noexcept;
  double valid_for_ticks(double max_ticks, double time_s) const noexcept;
  double service_ticks() const noexcept;
  double remaining_visits() const noexcept;
  std::uint32_t visits_this_tick(const Pose& X_service, double service) const noexcept;
  void adapt_horizon() noexcept;
  void make_current(CandidatePairs*& list) noexcept;

  const Scene& scene_;
  SurfaceSides sides_;
  std::array<CandidatePairs, 3> lists_;
  CandidatePairs* current_ = &lists_[0];  ///< in use
  CandidatePairs* next_ = &lists_[1];     ///< under construction, or waiting for its use
  CandidatePairs* spare_ = &lists_[2];    ///< for lists that are built immediately
  bool mispredicted_ = false;             ///< in this tick the tool left the path of the next list
  bool list_pending_ = false,
       deferred_tick_ = false;  ///< the list requested last is pending; a list of this tick was deferred
  std::uint32_t immediate_lists_ = 0;

  MotionPredictor predictor_;
  double last_scene_time_s_ = 0.0,
         tick_duration_s_ = 0.0;             ///< scene time of the last tick and its duration
  std::uint32_t prefetch_cost_visits_ = 0;   ///< cost of the last prefetched list
  std::uint32_t immediate_cost_visits_ = 0;  ///< cost of the last list that was built immediately
  double horizon_ticks_;                     ///< number of ticks that the next list shall serve
  double reach_scale_ = 1.0;  ///< multiple of the prefetch radius; grows with the prediction error
};

}  // namespace wrenchd
