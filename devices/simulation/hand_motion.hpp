// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/latest_value.hpp"
#include "devices/simulation/hand_path.hpp"

namespace wrenchd {

/// Goal that a client sets for the simulated hand. B = device base, G = goal of the handle.
struct HandGoal {
  Pose X_BG;
  TimePoint expires{};  ///< from this time on the hand returns to its path
};

/// Motion of the simulated hand: along its path, to the goal that a client has set, and back to the path
/// after the goal has expired. The speed and the acceleration of the way to a goal are bounded like those of
/// a person, whatever goals arrive:
///
///   v* = v_path + clamp(k (x_goal - x), v_max)     |v_next - v| <= a_max dt     (rotation: the same)
///
/// k v_max <= a_max, so the hand stops at the goal without overshoot. v_path is zero at a goal of a client.
/// Without a goal the motion is exactly the path.
class HandMotion {
 public:
  static constexpr double kGain_per_s = 40.0;
  static constexpr double kMaxSpeed_m_per_s = 1.25, kMaxSpeed_rad_per_s = 12.0;
  static constexpr double kMaxAcceleration_m_per_s2 = 50.0, kMaxAcceleration_rad_per_s2 = 500.0;

  /// Throws std::invalid_argument if the path of the settings is invalid. Not RT-safe: allocates.
  explicit HandMotion(const SimulationSettings& settings);

  /// Sets the goal; it replaces the goal before. Returns false if the handle follows its path exactly. One
  /// thread at a time; any thread. RT-safe.
  bool set_goal(const HandGoal& goal) noexcept;

  /// Returns the target after a step of dt_s that ends at `now`, which is `since_start` after the start of
  /// the path. RT-safe.
  HandTarget advance(TimePoint now, Duration since_start, double dt_s) noexcept;
  /// Returns the target of the last step; before the first step, the start of the path. RT-safe.
  const HandTarget& target() const noexcept { return target_; }

  /// True while the hand presses the grasp button on its path. RT-safe.
  bool grasps(Duration since_start) const noexcept { return path_.grasps(since_start); }

  /// True if the handle is exactly on the path, whatever the forces are. RT-safe.
  bool prescribed() const noexcept { return prescribed_; }

  /// Displaces the path, in B [m]. Precondition: no step yet. RT-safe.
  void displace(const Vector3d& d_B_m) noexcept;

 private:
  void step_toward(const HandTarget& goal, double dt_s) noexcept;

  HandPath path_;
  bool prescribed_;
  HandTarget target_;
  LatestValue<HandGoal> goals_;
  HandGoal goal_;        ///< newest goal
  bool on_path_ = true;  ///< the target is exactly on the path
};

}  // namespace wrenchd
