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

/// How the reports of a profile say how far a cap is pushed.
struct PuckCoding {
  EmulatedSpaceMouse::Format format;
  double translation_step_m = 0.0;  ///< of a count
  double rotation_step_rad = 0.0;
};

/// Throws std::invalid_argument where they do not.
PuckCoding puck_coding(const DeviceProfile& profile);

/// An emulated SpaceMouse in a simulated hand, which steers a tool by it along the hand path. It feels
/// nothing, but it sees where the handle is: where see() was told, and what the reports have made of it
/// since. Every millisecond it pushes the cap by, in the base B,
///
///   rate       v(t) = v_G + k (p_G - p_H),             v(r) = w_G + k log(R_G R_H')
///   position   linear_gain t = p_G,                    angular_gain r = log(R_G)
///
/// as far as the cap goes, to the nearest count. Where the path rests and the tool is there the cap is let
/// go.
class SimulatedPuck final : public DeviceInHand, private ReportSink {
 public:
  /// How much of a deviation the hand takes back in a second. Slow beside the 16 ms between two reports.
  static constexpr double kCorrection_per_s = 5.0;
  /// After a host has opened the device, until the hand has taken the cap.
  static constexpr Duration kGraspDelay = std::chrono::milliseconds(500);

  /// Throws std::invalid_argument where the settings make no sense.
  SimulatedPuck(const DeviceProfile& profile, const SimulationSettings& settings);

  void open(TimePoint now) override;
  /// What a pose says cannot be wrong: the device sends none.
  void inject(const SimulatedFault& fault) override;

  void advance_to(TimePoint t, ReportSink& host) noexcept override;
  bool take_command(TimePoint now, std::span<const std::uint8_t> bytes) noexcept override {
    return mouse_.take_command(now, bytes);
  }
  TimePoint next_event() const noexcept override { return mouse_.next_event(); }
  void observe_pose(TimePoint now, const Pose& X_BH) noexcept override;

  /// Of the tool, as the hand sees it.
  const Pose& X_BH() const noexcept override { return displayed_pose_.X_BH(); }
  const Wrench& motor_wrench() const noexcept override { return zero_wrench_; }
  HandTarget hand_target() const noexcept override { return path_.at(now_ - power_on_); }

 private:
  void take_report(TimePoint sent, std::span<const std::uint8_t> report) noexcept override;
  void integrate_displayed_pose(TimePoint now) noexcept;
  void update_deflection() noexcept;
  DeflectionPose initial_pose() const noexcept;

  DeviceProfile profile_;
  HandPath path_;
  PuckCoding coding_;
  SteeringCurve linear_, angular_;
  EmulatedSpaceMouse mouse_;
  DeflectionPose displayed_pose_;
  TimePoint displayed_at_{};
  PoseReport reported_;  ///< by the reports, together
  std::array<int, 6> counts_{};
  ReportSink* host_ = nullptr;

  bool powered_ = false;
  TimePoint power_on_{};
  TimePoint now_{};
  TimePoint grasped_at_{};
  Wrench zero_wrench_;
};

}  // namespace wrenchd
