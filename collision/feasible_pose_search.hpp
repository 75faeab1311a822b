// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <stop_token>

#include "collision/pairs/intersecting_pairs.hpp"
#include "collision/proxy.hpp"
#include "collision/scene.hpp"

namespace wrenchd {

/// Finds a way back where there is no history to follow: at the start, after the tool was changed or an
/// obstacle was put where it is.
///
/// Looks around p, nearer first, for poses at which nothing overlaps, lets a proxy come as near to p as it
/// can from each of them, and takes the nearest. It is admissible, and a local optimum; that no other place
/// is nearer is likely, not proven.
///
/// It takes milliseconds, deep inside a fine mesh seconds, and is no work for the servo thread. The scene is
/// kept by reference.
class FeasiblePoseSearch {
 public:
  explicit FeasiblePoseSearch(const Scene& scene);

  /// Does the tool overlap nothing at this pose, and is it outside of all that is solid? Obstacles stand as
  /// they do at scene time time_s.
  bool admissible(const Pose& X_WT, double time_s = 0.0) noexcept;

  /// Status infeasible where nothing was found. The contacts are those that hold q. Once stop is asked for it
  /// ends with what it has, after no more than one look at a pose or one tick of a proxy: a few milliseconds.
  /// time_s: as for admissible().
  Projection nearest(const Pose& X_WP, const std::stop_token& stop = {}, double time_s = 0.0) noexcept;

 private:
  Projection converge_proxy(const Pose& X_WP, const Pose& X_start, const std::stop_token& stop,
                            double time_s) noexcept;

  const Scene& scene_;
  HalfSpaceContacts half_spaces_;
  IntersectingPairs intersecting_pairs_;
  Proxy proxy_;
};

}  // namespace wrenchd
