// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "collision/near_pairs.hpp"
#include "collision/scene.hpp"

namespace wrenchd {

/// Lists of near pairs (near_pairs.hpp) for a tool that moves much as it did before: while one serves, the
/// next is made for where the tool will be, a little with every tick. Only where it did not go there is a
/// list made at once.
///
/// Memory is taken at construction. One object serves one thread.
class PairsAhead {
 public:
  /// So many pairs are looked at in the time of a visit.
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
  /// take more than what there is of the budget: the way is too long. RT safe.
  bool list(const Pose& X_start, const Pose& X_end, WalkBudget& budget) noexcept {
    return list(X_start, X_end, Times{}, budget);
  }
  bool list(const Pose& X_start, const Pose& X_end, const Times& times, WalkBudget& budget) noexcept;

  /// Once a tick, when the tool has come to X_WT at this scene time: goes on with the list for where it will
  /// be. RT safe.
  void look_ahead(const Pose& X_WT, WalkBudget& budget, double time_s = 0.0) noexcept;

  /// The tool is elsewhere now: how it moved says nothing about how it will. RT safe.
  void forget_motion() noexcept;

  const NearPairs& listed() const noexcept { return *listed_; }
  std::uint32_t edition() const noexcept { return edition_; }            ///< another with every other list
  std::uint32_t made_at_once() const noexcept { return made_at_once_; }  ///< lists, so far

 private:
  NearPairs::Way way_to_list(const Pose& X_start, const Pose& X_end, const Times& times) const noexcept;
  void learn_motion(const Pose& X_WT, double time_s) noexcept;
  Pose after(double ticks, const Pose& X_WT) const noexcept;
  NearPairs::Way way_ahead(const Pose& X_WT, double ticks) const noexcept;
  bool goes_slowly(const NearPairs::Way& way) const noexcept;
  bool set_out(const Pose& X_WT) noexcept;
  void weigh() noexcept;
  void serve(NearPairs*& list) noexcept;

  const Scene& scene_;
  std::array<NearPairs, 3> lists_;
  NearPairs* listed_ = &lists_[0];  ///< serves
  NearPairs* ahead_ = &lists_[1];   ///< is being made
  NearPairs* spare_ = &lists_[2];   ///< for what must be listed at once
  std::uint32_t edition_ = 0;
  std::uint32_t made_at_once_ = 0;

  std::uint32_t visits_of_list_ = 0;  ///< that the last one took
  double ticks_ahead_;                ///< that the next is made for

  std::optional<Pose> X_last_;                                        ///< of the tick before
  double last_s_ = 0.0, tick_s_ = 0.0;                                ///< its scene time, and how long it was
  Vector3d shift_m_ = Vector3d::Zero(), turn_ = Vector3d::Zero();     ///< per tick; the turn in T
  Vector3d bend_m_ = Vector3d::Zero(), bend_rad_ = Vector3d::Zero();  ///< by which they grow per tick
};

}  // namespace wrenchd
