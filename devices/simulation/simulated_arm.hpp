// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>

#include "core/device_profile.hpp"
#include "core/simulation_settings.hpp"
#include "devices/simulation/device_in_hand.hpp"
#include "devices/simulation/emulated_arm.hpp"
#include "devices/simulation/simulated_handle.hpp"

namespace wrenchd {

/// Emulated arm in a simulated hand. D = the device's own frame, E = its end frame; J and the joint angles
/// follow from the kinematics of the profile. Each substep computes:
///
///   f_D = J^-T tau,   tau from the motor efforts              force on the handle at E
///   encoder counts of the angles that reach E at X_DB X_BH X_HE
///
/// An arm without a wrist does not rotate its handle. At the boundary of the workspace there is an end stop:
/// the handle keeps its pose. The handle starts at the first waypoint of the hand path, or at the nearest
/// reachable pose between the home position and this waypoint.
class SimulatedArm final : public DeviceInHand {
 public:
  /// Maximum catch-up of advance_to() in one call. After a longer gap the handle rests at its pose.
  static constexpr Duration kMaxCatchUp = std::chrono::seconds(1);
  /// Time that the operator needs to home the device.
  static constexpr Duration kHomingDelay = std::chrono::milliseconds(500);

  /// Throws std::invalid_argument if the settings or the kinematics are invalid.
  SimulatedArm(const DeviceProfile& profile, const SimulationSettings& settings,
               std::unique_ptr<EmulatedArm> arm);

  void open(TimePoint) override { arm_->start(); }
  /// Throws std::invalid_argument for faults that an arm cannot have, such as bad_quaternion. Not RT-safe:
  /// allocates.
  void inject(const SimulatedFault& fault) override;

  void advance_to(TimePoint t, ReportSink& host) noexcept override;
  bool take_command(TimePoint now, std::span<const std::uint8_t> bytes) noexcept override {
    return arm_->take_command(now, bytes);
  }
  TimePoint next_event() const noexcept override { return arm_->next_event(); }

  const Pose& X_BH() const noexcept override { return handle_.X_BH(); }
  const Wrench& motor_wrench() const noexcept override { return handle_.motor_wrench(); }
  const HandTarget& hand_target() const noexcept override { return target_; }
  bool set_hand_goal(const HandGoal& goal) noexcept override { return hand_.set_goal(goal); }

 private:
  struct Configuration {
    Pose X_DE;
    JointAngles angles;
  };

  Pose start_pose(const std::string& profile) const;
  HandTarget reachable(HandTarget target) const noexcept;
  std::optional<Configuration> find_configuration(const Pose& X_BH) const noexcept;
  Wrench motor_demand() const noexcept;
  void set_encoders(const Pose& X_BH) noexcept;
  void substep() noexcept;

  Kinematics kinematics_;
  Pose X_BD_, X_DB_, X_EH_, X_HE_;
  bool has_wrist_;  ///< true if the arm has a wrist
  HandMotion hand_;
  HandTarget target_;  ///< pose and twist that the hand aims at; an arm without a wrist keeps its rotation
  std::unique_ptr<EmulatedArm> arm_;
  SimulatedHandle handle_;
  Configuration configuration_;  ///< configuration at the pose of the handle

  bool powered_ = false;
  TimePoint power_on_{};
  TimePoint now_{};
  Duration homing_requested_for_{};  ///< time since the host requested homing
};

}  // namespace wrenchd
