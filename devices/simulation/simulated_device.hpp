// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <span>

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "core/simulation_settings.hpp"
#include "devices/report_codec.hpp"
#include "devices/simulation/device_in_hand.hpp"
#include "devices/simulation/hand_path.hpp"
#include "devices/simulation/simulated_firmware.hpp"
#include "devices/simulation/simulated_handle.hpp"

namespace wrenchd {

/// The far side of a transport: a handle in a hand, motors, encoders and firmware. A pure function of
/// profile, settings, faults and the commands with their times: the same in, the same bits out, however the
/// time in between was cut into calls. Where the profile has [frames], it says where its own end is in its
/// own axes, and takes wrenches about that in those. It starts at rest at the first waypoint of the hand
/// path. Where the profile's wrench point is the world origin, the simulated device stands in it.
class SimulatedDevice final : public DeviceInHand {
 public:
  /// How far advance_to() catches up in one call, see there.
  static constexpr Duration kMaxCatchUp = std::chrono::seconds(1);

  /// Throws std::invalid_argument where the profile's layouts or the settings make no sense.
  SimulatedDevice(const DeviceProfile& profile, const SimulationSettings& settings);

  /// Lets time pass up to t in fixed substeps: 1/16 ms, or an eighth of the report period where that is less.
  /// The first call switches the power on at t. After a gap of more than kMaxCatchUp the device does not live
  /// through it: clock, hand path and sequence jump by whole report periods, the handle rests where it was
  /// and the watchdog has tripped. RT safe.
  void advance_to(TimePoint t, ReportSink& host) noexcept override;
  bool take_command(TimePoint now, std::span<const std::uint8_t> bytes) noexcept override;
  /// When the next report leaves, silent or not.
  TimePoint next_event() const noexcept override;

  // The truth, for tests: not what the encoders see.
  TimePoint now() const noexcept { return now_; }
  const Pose& X_BH() const noexcept override { return handle_.X_BH(); }
  const Twist& V_BH() const noexcept { return handle_.V_BH(); }
  const Wrench& motor_wrench() const noexcept override { return handle_.motor_wrench(); }
  HandTarget hand_target() const noexcept override { return path_.at(now_ - power_on_); }
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
  Pose X_BD_, X_HE_;
  bool same_frames_;                   ///< D is B and E is H
  std::uint64_t substeps_per_sample_;  ///< of the encoders
  std::uint64_t substeps_per_report_;
  Duration substep_;

  HandPath path_;
  bool prescribed_motion_;  ///< the handle is on the path, whatever pushes
  SimulatedHandle handle_;
  SimulatedFirmware firmware_;
  Pose last_unstuck_pose_;  ///< what the encoders said before they got stuck

  bool powered_ = false;
  TimePoint power_on_{};
  TimePoint now_{};
  std::uint64_t substeps_ = 0;
};

}  // namespace wrenchd
