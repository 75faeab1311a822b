// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "core/simulation_settings.hpp"
#include "devices/firmware/wrench_firmware.h"
#include "devices/simulation/emulated_device.hpp"
#include "devices/simulation/hand_path.hpp"
#include "devices/simulation/simulated_handle.hpp"

namespace wrenchd::test {

using CommandBytes = std::vector<std::uint8_t>;
using ReportBytes = std::vector<std::uint8_t>;

/// Writes the checksum of the open report layout over the bytes before it.
void seal(std::span<std::uint8_t> report);

/// The mistakes of a maker around the firmware core: changes of what goes into the core and what comes out of
/// it. An empty function changes nothing.
struct FirmwareMistakes {
  std::function<void(ReportBytes&)> report;  ///< changes a report before it is sent
  /// Changes a command, or the core, before the core receives the command.
  std::function<void(CommandBytes&, wf_firmware&)> command;
  std::function<void(wf_wrench&)> wrench;  ///< changes the wrench between the core and the motors
  /// Changes the clock of the motor context [us].
  std::function<std::uint32_t(std::uint32_t)> motor_clock;
};

/// The firmware core of devices/firmware/ in a simulated device: a handle in a hand, encoders, motors and a
/// clock that wraps one second after power-on. It sends 8 samples and 16 motor periods per report.
class FirmwareInHand final : public EmulatedDevice {
 public:
  /// The profile states the report rate and the hold time; the settings describe the handle and the hand.
  FirmwareInHand(const DeviceProfile& profile, const SimulationSettings& settings,
                 FirmwareMistakes mistakes = {});

  void advance_to(TimePoint t, ReportSink& host) noexcept override;
  bool take_command(TimePoint now, std::span<const std::uint8_t> bytes) noexcept override;
  TimePoint next_event() const noexcept override;

  TimePoint now() const noexcept { return now_; }
  const Pose& X_BH() const noexcept { return handle_.X_BH(); }
  const Twist& V_BH() const noexcept { return handle_.V_BH(); }
  /// Wrench of the motors on the hand, about the handle point, in B.
  const Wrench& motor_wrench() const noexcept { return handle_.motor_wrench(); }
  wf_firmware& firmware() noexcept { return firmware_; }
  std::uint64_t commands() const noexcept { return commands_; }  ///< commands received, valid or not
  /// Largest force and torque of the motors since the start.
  double max_force_N() const noexcept { return max_force_N_; }
  double max_torque_Nm() const noexcept { return max_torque_Nm_; }

 private:
  static constexpr std::uint64_t kSubstepsPerSample = 2, kSubstepsPerReport = 16;

  std::uint32_t clock_us() const noexcept;
  void substep(ReportSink& host) noexcept;
  void read_encoders() noexcept;

  Duration substep_;
  HandPath path_;
  SimulatedHandle handle_;
  double position_quantum_m_, rotation_quantum_rad_;
  FirmwareMistakes mistakes_;
  wf_firmware firmware_{};
  wf_velocity velocity_{};
  wf_sample sample_{};
  bool powered_ = false;
  TimePoint power_on_{}, now_{};
  std::uint64_t substeps_ = 0;
  std::uint64_t commands_ = 0;
  double max_force_N_ = 0.0, max_torque_Nm_ = 0.0;
};

}  // namespace wrenchd::test
