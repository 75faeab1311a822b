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

/// An emulated arm in a simulated hand. In each substep, D being the device's own base axes, E its end, and J
/// and the angles those of the kinematics the profile names:
///
///   f_D = J^-T tau,   tau from what the motors do        pushes the handle at E
///   counts of the angles that hold E at X_DB X_BH X_HE   are where the encoders stand
///
/// An arm without a wrist does not turn its handle. Out of reach there is an end stop: the handle stays where
/// it was. It starts at the first waypoint of the hand path, or as near to it as it comes from home.
class SimulatedArm final : public DeviceInHand {
 public:
  /// How far advance_to() catches up in one call: after a longer gap the handle rests where it was.
  static constexpr Duration kMaxCatchUp = std::chrono::seconds(1);
  /// How long a person takes to do what homing asks for.
  static constexpr Duration kHomingDelay = std::chrono::milliseconds(500);

  /// Throws std::invalid_argument where the settings or the kinematics make no sense.
  SimulatedArm(const DeviceProfile& profile, const SimulationSettings& settings,
               std::unique_ptr<EmulatedArm> arm);

  void open(TimePoint) override { arm_->start(); }
  /// An orientation of half the length is not among what an arm can say.
  void inject(const SimulatedFault& fault) override;

  void advance_to(TimePoint t, ReportSink& host) noexcept override;
  bool take_command(TimePoint now, std::span<const std::uint8_t> bytes) noexcept override {
    return arm_->take_command(now, bytes);
  }
  TimePoint next_event() const noexcept override { return arm_->next_event(); }

  const Pose& X_BH() const noexcept override { return handle_.X_BH(); }
  const Wrench& motor_wrench() const noexcept override { return handle_.motor_wrench(); }
  HandTarget hand_target() const noexcept override { return target_at(now_ - power_on_); }

 private:
  struct Configuration {
    Pose X_DE;
    JointAngles angles;
  };

  Pose start_pose(const std::string& profile) const;
  HandTarget target_at(Duration since_start) const noexcept;
  std::optional<Configuration> find_configuration(const Pose& X_BH) const noexcept;
  Wrench motor_demand() const noexcept;
  void set_encoders(const Pose& X_BH) noexcept;
  void substep() noexcept;

  Kinematics kinematics_;
  Pose X_BD_, X_DB_, X_EH_, X_HE_;
  bool has_wrist_;  ///< has a wrist
  HandPath path_;
  bool prescribed_motion_;  ///< the handle is on the path, whatever pushes
  std::unique_ptr<EmulatedArm> arm_;
  SimulatedHandle handle_;
  Configuration configuration_;  ///< of the handle

  bool powered_ = false;
  TimePoint power_on_{};
  TimePoint now_{};
  Duration homing_requested_for_{};  ///< for how long
};

}  // namespace wrenchd
