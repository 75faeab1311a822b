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
struct CandidatePair {
  std::uint32_t a, b;
  std::uint32_t obstacle;  ///< its place among scene.meshes()
};

/// The pairs of triangles that may meet while the tool is on a straight way, or near it, with features that
/// can meet first (mesh_surface.hpp). They are listed in one go, or a few with every tick while another list
/// serves. Where an obstacle moves, what counts is the way of the tool as that obstacle sees it.
///
/// Memory is taken at construction. One object serves one thread.
class CandidatePairs {
 public:
  struct Path {
    Pose X_WT_start, X_WT_end;
    double reach_m = 0.0;               ///< the list holds for poses as near to it, as way_m() measures
    double start_s = 0.0, end_s = 0.0;  ///< scene time at both ends; it matters where obstacles move
  };

  /// The scene is kept by reference.
  explicit CandidatePairs(const Scene& scene);
  CandidatePairs(const CandidatePairs&) = delete;  // a copy would lose the room that is kept
  CandidatePairs& operator=(const CandidatePairs&) = delete;

  /// Begins a list; the one before is lost. RT safe.
  void start(const Path& way) noexcept;
  /// Goes on with it until it has ended (true) or the budget is used up. RT safe.
  bool resume(VisitBudget& budget) noexcept;

  /// There is no list any more. RT safe.
  void clear() noexcept;

  bool in_progress() const noexcept { return state_ == State::in_progress; }
  /// Are all pairs listed? Not where there was no room for them.
  bool complete() const noexcept { return state_ == State::complete; }
  /// Does the list hold for this pose at this scene time, and for straight ways to others that it holds for?
  bool covers(const Pose& X_WT, double time_s = 0.0) const noexcept {
    return complete() && will_cover(X_WT, time_s);
  }
  /// The same of a list that is under way.
  bool will_cover(const Pose& X_WT, double time_s = 0.0) const noexcept;

  std::span<const CandidatePair> pairs() const noexcept { return pairs_; }
  PairCuller& culler() noexcept { return culler_; }  ///< of pairs()
  /// The obstacles that may be met on the way: places among scene.meshes().
  std::span<const std::uint32_t> nearby_obstacles() const noexcept { return nearby_obstacles_; }
  std::uint32_t node_visits() const noexcept { return node_visits_; }  ///< that the list has taken so far

  /// How much farther from the way a pose may lie for the list to hold for it, obstacles that move left
  /// aside; less than zero: it does not [m].
  double margin_m(const Pose& X_WT) const noexcept { return path_.reach_m - distance_m(path_, X_WT); }
  /// How far a pose is from a way [m].
  double distance_m(const Path& way, const Pose& X_WT) const noexcept;
  /// How far a point of the tool may be moved from one pose to the other [m].
  double displacement_bound_m(const Pose& from, const Pose& to) const noexcept;

 private:
  enum class State : std::uint8_t { empty, in_progress, complete, failed };

  /// A way as a moving obstacle sees it.
  struct RelativePath {
    std::uint32_t obstacle;
    Path path;
  };

  void find_nearby_static_obstacles() noexcept;
  void find_nearby_moving_obstacles() noexcept;
  void start_next_obstacle() noexcept;
  bool append_found_pairs() noexcept;

  const Scene& scene_;
  BvhTraversal traversal_;
  State state_ = State::empty;
  Path path_;
  std::uint32_t node_visits_ = 0;
  std::size_t next_obstacle_ = 0;  ///< of nearby_obstacles_, to be walked
  std::size_t appended_ = 0;       ///< pairs of that walk
  std::vector<CandidatePair> pairs_;
  PairCuller culler_;

  std::vector<std::uint32_t>
      nearby_obstacles_;                 ///< those at rest first, that may be met while the tool stays
  std::size_t nearby_static_count_ = 0;  ///< so many
  Vector3d nearby_centre_W_m_ = Vector3d::Zero();  ///< within
  double nearby_radius_m_ = -1.0;                  ///< of this place
  std::vector<RelativePath> relative_paths_;       ///< the way, for those of nearby_obstacles_ that move
};

}  // namespace wrenchd
