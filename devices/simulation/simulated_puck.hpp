// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/device_profile.hpp"
#include "core/simulation_settings.hpp"
#include "devices/deflection_pose.hpp"
#include "devices/report_codec.hpp"
#include "devices/simulation/device_in_hand.hpp"
#include "devices/simulation/emulated_spacemouse.hpp"

namespace wrenchd {

/// Coding of the puck deflection in the reports of a profile.
struct PuckCoding {
  EmulatedSpaceMouse::Format format;
  double translation_step_m = 0.0;  ///< translation of one count
  double rotation_step_rad = 0.0;
};

/// Returns the coding of a profile. Throws std::invalid_argument if the reports do not carry the deflection.
/// Not RT-safe: allocates.
PuckCoding puck_coding(const DeviceProfile& profile);

/// Emulated SpaceMouse in a simulated hand. The hand steers a tool along the hand path. It receives no force,
/// but it observes the pose of the handle: the displayed pose (observe_pose()), integrated with the reports
/// sent since. Every millisecond it sets the deflection of the puck, in the base B, from
///
///   rate       v(t) = v_G + k (p_G - p_H),             v(r) = w_G + k log(R_G R_H')
///   position   linear_gain t = p_G,                    angular_gain r = log(R_G)
///
/// limited to the full deflection and rounded to the nearest count. When the path rests and the tool is at
/// its goal, the hand releases the puck.
class SimulatedPuck final : public DeviceInHand, private ReportSink {
 public:
  /// Feedback gain k of the hand. Slow compared to the 16 ms between two reports.
  static constexpr double kCorrection_per_s = 5.0;
  /// Time from the opening of the device until the hand grasps the puck.
  static constexpr Duration kGraspDelay = std::chrono::milliseconds(500);

  /// Throws std::invalid_argument if the settings are invalid.
  SimulatedPuck(const DeviceProfile& profile, const SimulationSettings& settings);

  void open(TimePoint now) override;
  /// Throws std::invalid_argument for faults of a pose, because the device sends none. Not RT-safe:
  /// allocates.
  void inject(const SimulatedFault& fault) override;

  void advance_to(TimePoint t, ReportSink& host) noexcept override;
  bool take_command(TimePoint now, std::span<const std::uint8_t> bytes) noexcept override {
    return mouse_.take_command(now, bytes);
  }
  TimePoint next_event() const noexcept override { return mouse_.next_event(); }
  void observe_pose(TimePoint now, const Pose& X_BH) noexcept override;

  /// Pose of the handle as observed by the hand. RT-safe.
  const Pose& X_BH() const noexcept override { return displayed_pose_.X_BH(); }
  const Wrench& motor_wrench() const noexcept override { return zero_wrench_; }
  const HandTarget& hand_target() const noexcept override { return hand_.target(); }
  bool set_hand_goal(const HandGoal& goal) noexcept override { return hand_.set_goal(goal); }

 private:
  void take_report(TimePoint sent, std::span<const std::uint8_t> report) noexcept override;
  void integrate_displayed_pose(TimePoint now) noexcept;
  void update_deflection() noexcept;
  DeflectionPose initial_pose() const noexcept;

  DeviceProfile profile_;
  HandMotion hand_;
  PuckCoding coding_;
  SteeringCurve linear_, angular_;
  EmulatedSpaceMouse mouse_;
  DeflectionPose displayed_pose_;
  TimePoint displayed_at_{};
  PoseReport reported_;  ///< content of the last reports, merged
  std::array<int, 6> counts_{};
  ReportSink* host_ = nullptr;

  bool powered_ = false;
  TimePoint power_on_{};
  TimePoint now_{};
  TimePoint grasped_at_{};
  Wrench zero_wrench_;
};

}  // namespace wrenchd
