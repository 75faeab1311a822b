// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "core/clock.hpp"
#include "core/command.hpp"

namespace wrenchd {

/// A temporary fault of a simulated device; devices/README.md describes each kind.
struct SimulatedFault {
  enum class Kind : std::uint8_t {
    // Link
    unplug,           ///< the device is gone; the link stays closed until it is opened again
    silence,          ///< no reports arrive
    freeze,           ///< the last report arrives again and again, with the same sequence number
    repeat,           ///< each report arrives twice
    swap,             ///< each report arrives after its successor
    drop_reports,     ///< one of `value` reports does not arrive (default 3)
    delay_reports,    ///< reports arrive `value` seconds late (default 0.01)
    corrupt,          ///< one bit of each report is inverted, so its checksum is wrong
    short_report,     ///< reports arrive with half of their length
    long_report,      ///< reports arrive with one extra byte
    wrong_id,         ///< the first byte of each report is wrong
    reject_commands,  ///< the link accepts no commands
    drop_commands,    ///< the link accepts commands and drops them
    stall,            ///< a read blocks until the fault ends
    // Content of the reports
    bad_quaternion,  ///< the norm of the orientation is 0.5
    jump,            ///< the position jumps by `value` metres along x (default 0.1)
    drift,           ///< the position moves back and forth along x at `value` m/s (default 3)
    vibrate,         ///< the position oscillates along z with `value` metres at 80 Hz (default 0.001)
    freeze_pose,     ///< position and orientation are constant; the twist continues
    press_button,    ///< button number `value` is pressed (default 0)
    // Firmware
    trip_watchdog,     ///< the watchdog trips at the start of the fault
    disable_watchdog,  ///< the watchdog never trips
    motors_off,        ///< the motors are off, and the report states it
  };
  Kind kind = Kind::silence;
  Duration start{};  ///< start time since power-on
  Duration duration{};
  double value = 0.0;  ///< size of the fault; 0 selects the default of the kind
};

/// True if the fault acts on the link. Such faults apply to any device; the others only to the simulated
/// device.
constexpr bool affects_link(SimulatedFault::Kind kind) noexcept {
  return kind <= SimulatedFault::Kind::stall;
}

/// A request to the servo loop at a given time.
struct TimedCommand {
  Duration at{};  ///< time since the start of the run
  CommandSet commands = kNoCommand;
};

/// Script of a loopback run: faults of the simulated device and requests to the servo loop.
struct LoopbackScript {
  std::filesystem::path file;
  std::vector<SimulatedFault> faults;
  std::vector<TimedCommand> commands;  ///< in ascending time
};

}  // namespace wrenchd
