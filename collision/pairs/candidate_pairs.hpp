// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "collision/pairs/bvh_traversal.hpp"
#include "collision/pairs/pair_culler.hpp"
#include "collision/scene.hpp"

namespace wrenchd {

/// A triangle of the tool and one of an obstacle.
struct NearPair {
  std::uint32_t a, b;
  std::uint32_t obstacle;  ///< its place among scene.meshes()
};

/// The pairs of triangles that may meet while the tool is on a straight way, or near it, with features that
/// can meet first (mesh_surface.hpp). They are listed in one go, or a few with every tick while another list
/// serves. Where an obstacle moves, what counts is the way of the tool as that obstacle sees it.
///
/// Memory is taken at construction. One object serves one thread.
class NearPairs {
 public:
  struct Way {
    Pose X_WT_start, X_WT_end;
    double reach_m = 0.0;               ///< the list holds for poses as near to it, as way_m() measures
    double start_s = 0.0, end_s = 0.0;  ///< scene time at both ends; it matters where obstacles move
  };

  /// The scene is kept by reference.
  explicit NearPairs(const Scene& scene);
  NearPairs(const NearPairs&) = delete;  // a copy would lose the room that is kept
  NearPairs& operator=(const NearPairs&) = delete;

  /// Begins a list; the one before is lost. RT safe.
  void set_out(const Way& way) noexcept;
  /// Goes on with it until it has ended (true) or the budget is used up. RT safe.
  bool go_on(WalkBudget& budget) noexcept;

  /// There is no list any more. RT safe.
  void clear() noexcept;

  bool under_way() const noexcept { return state_ == State::under_way; }
  /// Are all pairs listed? Not where there was no room for them.
  bool complete() const noexcept { return state_ == State::complete; }
  /// Does the list hold for this pose at this scene time, and for straight ways to others that it holds for?
  bool covers(const Pose& X_WT, double time_s = 0.0) const noexcept {
    return complete() && will_cover(X_WT, time_s);
  }
  /// The same of a list that is under way.
  bool will_cover(const Pose& X_WT, double time_s = 0.0) const noexcept;

  std::span<const NearPair> pairs() const noexcept { return pairs_; }
  PairSieve& sieve() noexcept { return sieve_; }  ///< of pairs()
  /// The obstacles that may be met on the way: places among scene.meshes().
  std::span<const std::uint32_t> near_by() const noexcept { return near_by_; }
  std::uint32_t visits() const noexcept { return visits_; }  ///< that the list has taken so far

  /// How much farther from the way a pose may lie for the list to hold for it, obstacles that move left
  /// aside; less than zero: it does not [m].
  double room_m(const Pose& X_WT) const noexcept { return way_.reach_m - away_m(way_, X_WT); }
  /// How far a pose is from a way [m].
  double away_m(const Way& way, const Pose& X_WT) const noexcept;
  /// How far a point of the tool may be moved from one pose to the other [m].
  double way_m(const Pose& from, const Pose& to) const noexcept;

 private:
  enum class State : std::uint8_t { empty, under_way, complete, failed };

  /// A way as a moving obstacle sees it.
  struct Relative {
    std::uint32_t obstacle;
    Way way;
  };

  void find_near_by() noexcept;
  void find_moving_near_by() noexcept;
  void set_out_for_next() noexcept;
  bool take_over() noexcept;

  const Scene& scene_;
  TreeWalk walk_;
  State state_ = State::empty;
  Way way_;
  std::uint32_t visits_ = 0;
  std::size_t next_ = 0;   ///< of near_by_, to be walked
  std::size_t taken_ = 0;  ///< pairs of that walk
  std::vector<NearPair> pairs_;
  PairSieve sieve_;

  std::vector<std::uint32_t> near_by_;       ///< those at rest first, that may be met while the tool stays
  std::size_t near_at_rest_ = 0;             ///< so many
  Vector3d near_p_WT_m_ = Vector3d::Zero();  ///< within
  double near_reach_m_ = -1.0;               ///< of this place
  std::vector<Relative> relative_;           ///< the way, for those of near_by_ that move
};

}  // namespace wrenchd
