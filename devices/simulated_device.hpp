// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "core/simulation_settings.hpp"
#include "devices/hand_path.hpp"
#include "devices/report_codec.hpp"
#include "devices/simulated_firmware.hpp"
#include "devices/simulated_handle.hpp"

namespace wrenchd {

/// One thing that goes wrong with the simulated device, for a while. devices/README.md tells what each does.
struct SimulatedFault {
  enum class Kind : std::uint8_t {
    unplug,          ///< the device is gone; the link stays gone until it is opened again
    silence,         ///< no reports
    freeze,          ///< the last report again and again, sequence and all
    garble,          ///< one bit of each report is wrong, so the checksum is too
    short_report,    ///< half of each report
    bad_quaternion,  ///< orientation of half the length
    teleport,        ///< position 0.1 m off along x
    deaf,            ///< no room for commands
  };
  Kind kind = Kind::silence;
  Duration start{};  ///< since power-on
  Duration duration{};
};

/// Takes the reports of the simulated device at the moment they leave it.
class ReportSink {
 public:
  /// RT safe.
  virtual void take_report(TimePoint sent, std::span<const std::uint8_t> report) noexcept = 0;

 protected:
  ~ReportSink() = default;
};

/// The far side of a transport: a handle in a hand, motors, encoders and firmware. A pure function of
/// profile, settings, faults and the commands with their times: the same in, the same bits out, however the
/// time in between was cut into calls. It starts at rest at the first waypoint of the hand path. Where the
/// profile's wrench point is the world origin, the simulated device stands in it.
class SimulatedDevice {
 public:
  /// How far advance_to() catches up in one call, see there.
  static constexpr Duration kMaxCatchUp = std::chrono::seconds(1);

  /// Throws std::invalid_argument where the profile's layouts or the settings make no sense.
  SimulatedDevice(const DeviceProfile& profile, const SimulationSettings& settings);

  /// Lets time pass up to t in fixed substeps: 1/16 ms, or an eighth of the report period where that is less.
  /// The first call switches the power on at t. After a gap of more than kMaxCatchUp the device does not live
  /// through it: clock, hand path and sequence jump by whole report periods, the handle rests where it was
  /// and the watchdog has tripped. RT safe.
  void advance_to(TimePoint t, ReportSink& host) noexcept;
  /// A command arrives, now. False where the firmware refuses it. RT safe.
  bool take_command(std::span<const std::uint8_t> bytes) noexcept;

  /// When the next report leaves, silent or not. RT safe.
  TimePoint next_report() const noexcept;
  /// Whether a fault of this kind shows at any moment from..to. RT safe.
  bool shows(SimulatedFault::Kind kind, TimePoint from, TimePoint to) const noexcept;

  /// Adds a fault to the plan. Not RT safe.
  void inject(const SimulatedFault& fault) { faults_.push_back(fault); }

  // The truth, for tests: not what the encoders see.
  TimePoint now() const noexcept { return now_; }
  const Pose& X_BH() const noexcept { return handle_.X_BH(); }
  const Twist& V_BH() const noexcept { return handle_.V_BH(); }
  const Wrench& motor_wrench() const noexcept { return handle_.motor_wrench(); }
  HandTarget hand_target() const noexcept { return path_.at(now_ - power_on_); }
  const SimulatedHandle& handle() const noexcept { return handle_; }
  const SimulatedFirmware& firmware() const noexcept { return firmware_; }

 private:
  bool shows(SimulatedFault::Kind kind) const noexcept { return shows(kind, now_, now_); }
  void skip_to(TimePoint t) noexcept;
  void substep(ReportSink& host) noexcept;
  void send_report(ReportSink& host) noexcept;
  Wrench motor_demand() noexcept;

  PoseReportLayout pose_layout_;
  WrenchPoint wrench_point_;
  std::uint64_t substeps_per_sample_;  ///< of the encoders
  std::uint64_t substeps_per_report_;
  Duration substep_;

  HandPath path_;
  SimulatedHandle handle_;
  SimulatedFirmware firmware_;
  std::vector<SimulatedFault> faults_;

  bool powered_ = false;
  TimePoint power_on_{};
  TimePoint now_{};
  std::uint64_t substeps_ = 0;
  std::array<std::uint8_t, kMaxReportBytes> report_{};  ///< the last one, as the firmware made it
};

}  // namespace wrenchd
