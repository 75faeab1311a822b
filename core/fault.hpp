// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "core/clock.hpp"
#include "core/transitions.hpp"

namespace wrenchd {

/// What can be wrong. In a tick a problem is a value, never an exception. The table behind fault_row() says
/// of each how it is found, what follows, and what to do about it.
enum class Fault : std::uint8_t {
  none,

  // The link and its reports
  device_lost,       ///< the transport says the device is gone
  wrong_device,      ///< another one came in its place
  report_malformed,  ///< of another length or id, or with a wrong checksum
  report_repeated,   ///< duplicate, or out of order
  report_missing,    ///< by sequence number
  link_lossy,        ///< too many of the three above
  sample_late,       ///< the newest pose is a few milliseconds old
  sample_stale,      ///< no new report for longer than the profile allows

  // What the reports say
  pose_not_finite,         ///< NaN or infinity in a reported pose or twist
  pose_not_a_rotation,     ///< reported quaternion is too far from unit norm
  pose_jumped,             ///< pose moved farther in one report than any hand can
  pose_outside_workspace,  ///< far out of the workspace
  pose_stuck,              ///< the pose stays, and the reported twist says it moves
  overspeed,               ///< handle faster than the profile allows
  not_homed,               ///< the encoders do not know where they are any more
  watchdog_tripped,        ///< the device's own watchdog took the motors' current while it was driven
  motors_off,              ///< the device says that its motors are off, and was told to drive them

  // The rendering
  wrench_not_finite,  ///< the rendering produced NaN or infinity
  projection_failed,  ///< no admissible pose was found for several ticks
  wrench_late,        ///< the wrench was ready too long after its pose

  // The loop and the machine
  tick_late,       ///< a tick came a few milliseconds late
  loop_stalled,    ///< no tick for longer than the configuration allows
  clock_reversed,  ///< the monotonic clock went back
  suspended,       ///< the machine slept
  write_blocked,   ///< the device takes no wrench for a few milliseconds
  write_failed,    ///< nor for longer

  // The hand and the motors
  oscillating,           ///< the force alternates with the motion: less stiffness from here on
  oscillation_persists,  ///< again, with what was left of it
  energy_generated,      ///< the rendering gives more energy than it took
  motors_stalled,        ///< full force against a hand that does not move
  overheated,            ///< the motors gave more than they can for ever

  // Who asked for it
  heartbeat_lost,     ///< whoever armed does not say any more that it is alive
  heartbeat_missing,  ///< nor ever did
  deadman_released,   ///< the button that has to be held is not
  stop_requested,     ///< emergency stop by a client or a signal
  stop_button,        ///< by the device's button

  // What went on for too long, and the test at the start
  degraded_too_long,
  degraded_too_often,
  self_test_reports,   ///< no half second of good reports
  self_test_rate,      ///< reports at another rate than the profile's
  self_test_watchdog,  ///< the device's watchdog did not trip when it should have
};
inline constexpr std::size_t kFaultCount = static_cast<std::size_t>(Fault::self_test_watchdog) + 1;

/// What wrenchd knows of a fault: one row of the table.
struct FaultRow {
  Fault fault;
  std::string_view name;      ///< as it stands in records and status: "device_lost"
  Trigger trigger;            ///< what it is to the state machine
  Reaction reaction;          ///< of its own, where harder than the transition's
  Duration persistence;       ///< how long it has to be there; the reaction comes within one tick after that
  std::string_view detector;  ///< how it is found
  std::string_view message;   ///< what happened
  std::string_view reason;    ///< why anybody looks for it
  std::string_view cure;      ///< what to do about it
};

/// All faults but `none`, in order.
std::span<const FaultRow> fault_rows() noexcept;

/// The row of a fault. Never fails: an unknown value reads "unknown". RT safe.
const FaultRow& fault_row(Fault fault) noexcept;

/// A set of faults, as bits.
using FaultSet = std::uint64_t;
constexpr FaultSet bit(Fault fault) noexcept {
  return FaultSet{1} << static_cast<unsigned>(fault);
}

}  // namespace wrenchd
