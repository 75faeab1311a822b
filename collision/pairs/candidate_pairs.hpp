// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "collision/pairs/bvh_traversal.hpp"
#include "collision/pairs/pair_culler.hpp"
#include "collision/scene.hpp"
#include "collision/surface_sides.hpp"

namespace wrenchd {

/// A triangle of the tool (a) and a triangle of an obstacle (b).
struct CandidatePair {
  std::uint32_t a, b;
  std::uint32_t obstacle;  ///< index in scene.meshes()
};

/// A list of the pairs of triangles that may meet while the tool moves on a path or near it. It contains only
/// pairs with features that can meet first (meshes/mesh_surface.hpp). A list is built at once, or in parts
/// over several ticks while another list is in use. If an obstacle moves, the tool's path in the frame of the
/// obstacle counts.
///
/// The constructor allocates all memory. One object serves one thread. All members but the constructor are
/// RT-safe.
class CandidatePairs {
 public:
  struct Path {
    Pose X_WT_start, X_WT_end;
    /// the list covers poses up to this distance from the path; see displacement_bound_m()
    double reach_m = 0.0;
    double start_s = 0.0, end_s = 0.0;  ///< scene time at both ends [s]; used if obstacles move
  };

  /// Keeps references to the scene and to the sides on which the tool is; both must outlive this object.
  /// sides: null if they are not known. Not RT-safe: allocates.
  explicit CandidatePairs(const Scene& scene, SurfaceSides* sides = nullptr);
  CandidatePairs(const CandidatePairs&) = delete;  // a copy would lose the reserved memory
  CandidatePairs& operator=(const CandidatePairs&) = delete;

  /// Starts a new list and discards the previous one. RT-safe.
  void start(const Path& path) noexcept;
  /// Continues the list until it has ended (returns true) or the budget is spent (returns false). RT-safe.
  bool resume(VisitBudget& budget) noexcept;

  /// Discards the list. RT-safe.
  void clear() noexcept;

  bool in_progress() const noexcept { return state_ == State::in_progress; }
  /// True if the list contains all pairs; false if the room for pairs was too small.
  bool complete() const noexcept { return state_ == State::complete; }
  /// True if the list is complete and covers this pose at scene time time_s. It then also covers straight
  /// paths to other covered poses. RT-safe.
  bool covers(const Pose& X_WT, double time_s = 0.0) const noexcept {
    return complete() && will_cover(X_WT, time_s);
  }
  /// True if the list covers, or will cover when it is complete, this pose at scene time time_s. RT-safe.
  bool will_cover(const Pose& X_WT, double time_s = 0.0) const noexcept;

  std::span<const CandidatePair> pairs() const noexcept { return pairs_; }
  PairCuller& culler() noexcept { return culler_; }  ///< culler of pairs()
  /// Indices in scene.meshes() of the obstacles that the tool may meet on the path.
  std::span<const std::uint32_t> nearby_obstacles() const noexcept { return nearby_obstacles_; }
  std::uint32_t node_visits() const noexcept { return node_visits_; }  ///< work spent on this list so far

  /// Returns the reach of the list minus the distance of X_WT from its path [m]. Negative: the list does not
  /// cover the pose. Ignores the motion of obstacles. RT-safe.
  double margin_m(const Pose& X_WT) const noexcept { return path_.reach_m - distance_m(path_, X_WT); }
  /// Returns the distance of a pose from a path, measured by displacement_bound_m() [m]. RT-safe.
  double distance_m(const Path& path, const Pose& X_WT) const noexcept;
  /// Returns METHOD (92), an upper bound for the displacement of any tool point between two poses [m].
  /// RT-safe.
  double displacement_bound_m(const Pose& from, const Pose& to) const noexcept;

 private:
  enum class State : std::uint8_t { empty, in_progress, complete, failed };

  /// The path in the frame of a moving obstacle.
  struct RelativePath {
    std::uint32_t obstacle;
    Path path;
  };

  void find_nearby_static_obstacles() noexcept;
  void find_nearby_moving_obstacles() noexcept;
  void start_next_obstacle() noexcept;
  bool append_found_pairs() noexcept;

  const Scene& scene_;
  SurfaceSides* sides_;
  BvhTraversal traversal_;
  State state_ = State::empty;
  Path path_;
  std::uint32_t node_visits_ = 0;
  std::size_t next_obstacle_ = 0;  ///< index in nearby_obstacles_ of the next traversal
  std::size_t appended_ = 0;       ///< number of pairs of the present traversal that are in pairs_
  std::vector<CandidatePair> pairs_;
  PairCuller culler_;

  std::vector<std::uint32_t> nearby_obstacles_;    ///< obstacles at rest first, then moving ones
  std::size_t nearby_static_count_ = 0;            ///< number of obstacles at rest in nearby_obstacles_
  Vector3d nearby_centre_W_m_ = Vector3d::Zero();  ///< the obstacles at rest are valid within this sphere
  double nearby_radius_m_ = -1.0;  ///< radius of the sphere; negative: no obstacles were selected yet [m]
  std::vector<RelativePath> relative_paths_;  ///< paths relative to the moving obstacles in nearby_obstacles_
};

}  // namespace wrenchd
