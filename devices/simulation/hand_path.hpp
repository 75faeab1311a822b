// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "core/clock.hpp"
#include "core/simulation_settings.hpp"
#include "core/spatial.hpp"
#include "devices/pose_spline.hpp"

namespace wrenchd {

/// Returns true if the handle follows the path exactly, independent of the forces of the device. RT-safe.
inline bool has_prescribed_motion(const SimulationSettings& settings) noexcept {
  return !settings.playback_path.empty() && settings.playback_mode == PlaybackMode::open;
}

/// Scripted path of the simulated hand. The hand rests at each waypoint. Between two waypoints it moves along
/// the line and about the axis that join them, at minimum jerk (Flash and Hogan 1985):
///
///   s(u) = 10 u^3 - 15 u^4 + 6 u^5        u = 0..1 between the two times
class HandPath {
 public:
  /// Throws std::invalid_argument if there is no waypoint, a number is not finite, the times do not rise
  /// strictly from 0, or a repeating path does not end at its start (to 1e-9 in each coordinate).
  HandPath(const std::vector<Waypoint>& waypoints, bool repeats);
  /// Makes the path of the settings: the recorded path if there is one, else the script. Throws like the
  /// constructor above and like PoseSpline.
  explicit HandPath(const SimulationSettings& settings);

  /// Returns the target at a time after the start of the path. After the last waypoint the path repeats, or
  /// the hand stays at the last waypoint. RT-safe.
  HandTarget at(Duration since_start) const noexcept;
  /// Returns true while the hand presses the grasp button. RT-safe.
  bool grasps(Duration since_start) const noexcept;

  /// Displaces the path, in B [m]. RT-safe.
  void displace(const Vector3d& d_B_m) noexcept { displacement_B_m_ += d_B_m; }

 private:
  struct Segment;
  HandTarget undisplaced(Duration since_start) const noexcept;
  bool ended(Duration since_start) const noexcept;
  const Segment& segment_at(Duration since_start) const noexcept;

  struct Segment {
    Duration start;
    Duration length;
    Pose X_BG;               ///< pose at the start
    Vector3d translation_m;  ///< translation from the start to the end, in B
    Vector3d rotation_rad;   ///< rotation vector from the start to the end, in B
    bool grasp;
  };

  std::vector<Segment> segments_;  ///< one segment per pair of waypoints
  HandTarget final_target_;
  bool final_grasp_ = false;
  Vector3d displacement_B_m_ = Vector3d::Zero();
  Duration end_{};
  bool repeats_;
  std::optional<PoseSpline> spline_;  ///< recorded path; replaces the segments if it is set
};

}  // namespace wrenchd
