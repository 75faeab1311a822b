// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "core/clock.hpp"
#include "core/transitions.hpp"

namespace wrenchd {

/// Faults that wrenchd detects. A problem in a tick is a value, never an exception. fault_row() returns for
/// each fault its detection, reaction and remedy.
enum class Fault : std::uint8_t {
  none,

  // Link and reports
  device_lost,       ///< the transport reports that the device is gone
  wrong_device,      ///< a different device is connected in place of the previous one
  report_malformed,  ///< a report has a wrong length, id or checksum
  report_repeated,   ///< a report is a duplicate or out of order
  report_missing,    ///< the sequence number of the reports has a gap
  link_lossy,        ///< too many malformed, repeated or missing reports
  sample_late,       ///< the newest pose is a few milliseconds old
  sample_stale,      ///< no new report within the time limit of the profile

  // Content of the reports
  pose_not_finite,         ///< a reported pose or twist contains NaN or infinity
  pose_not_a_rotation,     ///< the norm of a reported quaternion is too far from 1
  pose_jumped,             ///< the pose moved farther between two reports than a hand can
  pose_outside_workspace,  ///< the pose is far outside of the workspace
  pose_stuck,              ///< the pose is constant although the reported twist is not zero
  overspeed,               ///< the handle is faster than the profile allows
  not_homed,               ///< the encoders have lost their reference
  watchdog_tripped,        ///< the device's watchdog switched the motors off while wrenchd drove them
  motors_off,              ///< the device reports that its motors are off although wrenchd drives them

  // Rendering
  wrench_not_finite,  ///< the rendering returned NaN or infinity
  projection_failed,  ///< the projection found no admissible pose in several consecutive ticks
  wrench_late,        ///< the wrench was ready too long after its pose was sampled

  // Servo loop and machine
  tick_late,       ///< a tick started a few milliseconds late
  loop_stalled,    ///< no tick for longer than the configuration allows
  clock_reversed,  ///< the monotonic clock went backwards
  suspended,       ///< the machine was suspended
  write_blocked,   ///< the device has accepted no wrench for a few milliseconds
  write_failed,    ///< the device has accepted no wrench for longer than the limit

  // Hand and motors
  oscillating,           ///< the handle oscillates in contact; wrenchd reduces the stiffness
  oscillation_persists,  ///< the handle still oscillates at the reduced stiffness
  energy_generated,      ///< the rendering returned more energy than it absorbed
  motors_stalled,        ///< maximum force on a hand that does not move
  overheated,            ///< the motors exceeded their continuous rating

  // Clients and buttons
  heartbeat_lost,     ///< the heartbeat of the client that armed has stopped
  heartbeat_missing,  ///< the client that armed has never sent a heartbeat
  deadman_released,   ///< the dead man's button is not held
  stop_requested,     ///< emergency stop by a client or a signal
  stop_button,        ///< emergency stop by the device's stop button

  // Persistent degradation, and the self-test at the start
  degraded_too_long,
  degraded_too_often,
  self_test_reports,   ///< no half second of valid reports during the self-test
  self_test_rate,      ///< the report rate differs from the profile
  self_test_watchdog,  ///< the device's watchdog did not trip in the self-test

  // Two hands
  other_hand_released,  ///< the other hand, which held the same body, was released by a fault
};
inline constexpr std::size_t kFaultCount = static_cast<std::size_t>(Fault::other_hand_released) + 1;

/// Description of one fault.
struct FaultRow {
  Fault fault;
  std::string_view name;  ///< name in records and status, for example "device_lost"
  Trigger trigger;        ///< trigger that the fault sends to the state machine
  Reaction reaction;      ///< minimum reaction; the harder of it and the transition's reaction applies
  Duration persistence;   ///< time for which the condition must hold; the reaction follows within one tick
  std::string_view detector;  ///< how wrenchd detects the fault
  std::string_view message;   ///< what happened
  std::string_view reason;    ///< why wrenchd monitors this condition
  std::string_view cure;      ///< what to do now
};

/// Rows of all faults except `none`, in the order of the enumeration.
std::span<const FaultRow> fault_rows() noexcept;

/// Row of a fault. An unknown value returns a row named "unknown". RT-safe.
const FaultRow& fault_row(Fault fault) noexcept;

/// A set of faults as a bit mask.
using FaultSet = std::uint64_t;
constexpr FaultSet bit(Fault fault) noexcept {
  return FaultSet{1} << static_cast<unsigned>(fault);
}
/// Returns the first fault of a set in the order of the enumeration. Precondition: the set is not empty.
constexpr Fault first_fault(FaultSet faults) noexcept {
  return static_cast<Fault>(std::countr_zero(faults));
}

}  // namespace wrenchd
