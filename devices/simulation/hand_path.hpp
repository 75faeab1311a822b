// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "core/clock.hpp"
#include "core/simulation_settings.hpp"
#include "core/spatial.hpp"
#include "devices/pose_spline.hpp"

namespace wrenchd {

/// Whether the handle is where the path is, whatever the device pushes with.
inline bool has_prescribed_motion(const SimulationSettings& settings) noexcept {
  return !settings.playback_path.empty() && settings.playback_mode == PlaybackMode::open;
}

/// The scripted path of the simulated hand: rests at each waypoint, and between two of them moves as people
/// do, along the line and about the axis that join them, at minimum jerk (Flash and Hogan 1985):
///
///   s(u) = 10 u^3 - 15 u^4 + 6 u^5        u = 0..1 between the two times
class HandPath {
 public:
  /// Throws std::invalid_argument where there is no waypoint, a number is not finite, the times do not rise
  /// strictly from 0, or a path that repeats does not end where it began (to 1e-9 in each coordinate).
  HandPath(const std::vector<Waypoint>& waypoints, bool repeats);
  /// What the settings say: the path to be played back where there is one, else the script. Throws as above
  /// and as PoseSpline does.
  explicit HandPath(const SimulationSettings& settings);

  /// The target this long after the path began. After the last waypoint the path starts again, or the hand
  /// stays there. RT safe.
  HandTarget at(Duration since_start) const noexcept;

 private:
  struct Segment {
    Duration start;
    Duration length;
    Pose X_BG;               ///< at the start
    Vector3d translation_m;  ///< from the start to the end, in B
    Vector3d rotation_rad;   ///< rotation vector from the start to the end, in B
  };

  std::vector<Segment> segments_;  ///< one a pair of waypoints
  HandTarget final_target_;
  Duration end_{};
  bool repeats_;
  std::optional<PoseSpline> spline_;  ///< in the place of all of the above
};

}  // namespace wrenchd
