// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <span>

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "core/simulation_settings.hpp"
#include "devices/report_codec.hpp"
#include "devices/simulation/device_in_hand.hpp"
#include "devices/simulation/hand_motion.hpp"
#include "devices/simulation/simulated_firmware.hpp"
#include "devices/simulation/simulated_handle.hpp"

namespace wrenchd {

/// Simulated reference device: a handle in a hand, motors, encoders and firmware. Its output is a pure
/// function of profile, settings, faults, and the commands and goals of the hand with their times. Equal
/// inputs give equal bits, independent of how calls divide the time. If the profile has [frames], the device
/// reports its own end frame in its own base frame, and accepts wrenches there. It starts at rest at the
/// first waypoint of the hand path. If the wrench point of the profile is the world origin, the device base
/// is at the world origin.
class SimulatedDevice final : public DeviceInHand {
 public:
  /// Maximum catch-up of advance_to() in one call.
  static constexpr Duration kMaxCatchUp = std::chrono::seconds(1);

  /// Throws std::invalid_argument if the layouts of the profile or the settings are invalid. Not RT-safe:
  /// allocates.
  SimulatedDevice(const DeviceProfile& profile, const SimulationSettings& settings);

  /// Advances the device to time t in fixed substeps: 1/16 ms, or an eighth of the report period if that is
  /// less. The first call switches the power on at t. The device does not simulate a gap longer than
  /// kMaxCatchUp: clock, hand path and sequence advance by whole report periods, the handle rests at its
  /// pose, and the watchdog trips. RT-safe.
  void advance_to(TimePoint t, ReportSink& host) noexcept override;
  bool take_command(TimePoint now, std::span<const std::uint8_t> bytes) noexcept override;
  /// Returns the time of the next report, also while a silence fault is active. RT-safe.
  TimePoint next_event() const noexcept override;

  // True state of the handle, for tests; the encoders may report a different one.
  TimePoint now() const noexcept { return now_; }
  const Pose& X_BH() const noexcept override { return handle_.X_BH(); }
  bool set_hand_goal(const HandGoal& goal) noexcept override { return hand_.set_goal(goal); }
  bool displace_path(const Vector3d& d_B_m) override;
  const Twist& V_BH() const noexcept { return handle_.V_BH(); }
  const Wrench& motor_wrench() const noexcept override { return handle_.motor_wrench(); }
  const HandTarget& hand_target() const noexcept override { return hand_.target(); }
  const SimulatedHandle& handle() const noexcept { return handle_; }
  const SimulatedFirmware& firmware() const noexcept { return firmware_; }

 private:
  void skip_to(TimePoint t) noexcept;
  void substep(ReportSink& host) noexcept;
  void send_report(ReportSink& host) noexcept;
  void apply_report_faults(PoseReport& report) noexcept;
  void apply_firmware_faults() noexcept;
  Wrench motor_demand() noexcept;
  void express_in_device_frames(PoseReport& report) const noexcept;

  PoseReportLayout pose_layout_;
  WrenchPoint wrench_point_;
  std::uint32_t grasp_button_;
  Pose X_BD_, X_HE_;
  bool same_frames_;                   ///< true if D = B and E = H
  std::uint64_t substeps_per_sample_;  ///< substeps per encoder sample
  std::uint64_t substeps_per_report_;
  Duration substep_;

  HandMotion hand_;
  SimulatedHandle handle_;
  SimulatedFirmware firmware_;
  Pose last_unstuck_pose_;  ///< last reported pose before a freeze_pose fault

  bool powered_ = false;
  TimePoint power_on_{};
  TimePoint now_{};
  std::uint64_t substeps_ = 0;
};

}  // namespace wrenchd
