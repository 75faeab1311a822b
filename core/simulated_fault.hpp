// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "core/clock.hpp"
#include "core/command.hpp"

namespace wrenchd {

/// One thing that goes wrong with a simulated device, for a while. devices/README.md tells what each does.
struct SimulatedFault {
  enum class Kind : std::uint8_t {
    // The wire
    unplug,           ///< the device is gone; the link stays gone until it is opened again
    silence,          ///< no reports
    freeze,           ///< the last report again and again, sequence and all
    repeat,           ///< each report twice
    swap,             ///< each report after the one that follows it
    drop_reports,     ///< one report in `value` does not arrive (3)
    delay_reports,    ///< reports arrive `value` seconds later (0.01)
    corrupt,          ///< one bit of each report is wrong, so a checksum is too
    short_report,     ///< half of each report
    long_report,      ///< one byte too many
    wrong_id,         ///< the first byte is another
    refuse_commands,  ///< no room for commands
    drop_commands,    ///< commands are taken, and do not arrive
    stall,            ///< a read does not come back before the fault is over
    // What the device says
    bad_quaternion,  ///< orientation of half the length
    jump,            ///< position `value` metres off along x (0.1)
    drift,           ///< position runs along x at `value` m/s, to and fro (3)
    vibrate,         ///< position swings along z by `value` metres at 80 Hz (0.001)
    freeze_pose,     ///< position and orientation stay as they were; the twist goes on
    press_button,    ///< button number `value` is pressed (0)
    // What the firmware does
    trip_watchdog,     ///< its watchdog trips, at once
    disable_watchdog,  ///< its watchdog never trips
    motors_off,        ///< the motors are off, and it says so
  };
  Kind kind = Kind::silence;
  Duration start{};  ///< since power-on
  Duration duration{};
  double value = 0.0;  ///< how much of it; 0: as much as stands in brackets above
};

/// Whether it happens on the wire, whatever the device: the others only the simulated device can have.
constexpr bool affects_link(SimulatedFault::Kind kind) noexcept {
  return kind <= SimulatedFault::Kind::stall;
}

/// Something that is asked of the loop at a time.
struct TimedCommand {
  Duration at{};  ///< since the start of the run
  CommandSet commands = kNoCommand;
};

/// What a file says shall happen to a simulated device, and to the loop that drives it.
struct LoopbackScript {
  std::filesystem::path file;
  std::vector<SimulatedFault> faults;
  std::vector<TimedCommand> commands;  ///< by time
};

}  // namespace wrenchd
