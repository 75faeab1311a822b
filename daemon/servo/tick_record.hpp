// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>

namespace wrenchd {

/// Everything one tick saw and did, in plain numbers: what the live line shows, what a recording keeps, what
/// a replay compares. Field names carry frame and unit; daemon/recording/record_fields.cpp lists them.
///
/// Poses are x y z [m], qx qy qz qw. Wrenches are fx fy fz [N], tx ty tz [N.m].
struct TickRecord {
  std::uint64_t tick = 0;
  std::int64_t now_ns = 0;  ///< monotonic time at which the tick started

  // What came in
  std::int64_t arrived_ns = 0;  ///< when the sample reached the host
  double device_time_s = 0.0;
  std::uint64_t sequence = 0;
  std::uint64_t acknowledged_command = 0;
  std::uint32_t superseded = 0;
  std::uint32_t missing = 0;
  std::uint32_t rejected = 0;
  std::uint32_t repeated = 0;
  std::uint32_t buttons = 0;
  std::uint8_t fresh = 0;
  std::uint8_t motors_on = 0;
  std::uint8_t watchdog_tripped = 0;
  std::uint8_t homed = 0;
  std::uint8_t sample_fault = 0;        ///< Fault that the device found in its reports
  std::uint8_t write_fault = 0;         ///< Fault that the write came to
  std::uint16_t commands = 0;           ///< Command bits: what was asked for since the last tick
  std::uint64_t last_command_sent = 0;  ///< number of the last command sent before this tick
  std::int64_t suspended_ns = 0;        ///< how long the machine has slept since it was switched on
  std::array<double, 7> X_BH{};         ///< handle in the device base
  std::array<double, 6> V_BH{};         ///< linear [m/s], angular [rad/s]

  // What was made of it
  std::array<double, 7> X_WP{};  ///< body frame at the device pose, p
  std::array<double, 7>
      X_WQ{};                   ///< its projection, q; NaN while seeking or nowhere; where placed, the answer
  std::array<double, 6> eps{};  ///< Eq. (15) [m, rad]; NaN unless following
  std::array<double, 6> F_T{};  ///< body wrench, Eq. (16), before limits
  double energy = 0.0;          ///< T of Eq. (8) [kg m^2]; NaN unless following
  double kkt_residual = 0.0;    ///< likewise
  std::uint16_t contacts = 0;
  std::uint16_t iterations = 0;
  std::uint8_t projection_status = 0;     ///< ProjectionStatus; infeasible unless following
  std::uint8_t proxy_initialization = 0;  ///< Placing

  // What was changed from outside while the loop ran
  std::uint32_t rendering_id = 0;  ///< number of the one that all of the above is of; 0: that of the start
  std::uint32_t change_count = 0;  ///< how many so far, of whatever
  std::uint64_t rendering_checksum = 0;  ///< Rendering::sum()
  double next_rendering_weight = 0.0;    ///< of F_out that another rendering has, which takes its place
  double contact_gain = 1.0;             ///< share of the contact's wrench that the workspace lets through

  // What went out
  std::uint8_t state = 0;          ///< State
  std::uint8_t state_cause = 0;    ///< Fault that led to it
  std::uint64_t faults = 0;        ///< FaultSet: all that was found in this tick
  std::uint16_t limit_causes = 0;  ///< LimitCause bits
  std::uint8_t undriven_dofs = 0;  ///< components of the wrench that the device has no motors for, as DofMask
  std::uint8_t motors_commanded = 0;  ///< 1: the command says motors on
  std::uint8_t released = 0;          ///< 1: the hand was released in this record; F_out is zero
  double authority = 0.0;
  double stiffness_scale = 0.0;   ///< of the spring that the configuration asks for
  double passivity_scale = 0.0;   ///< of the wrench that the passivity guard leaves
  double energy_in_J = 0.0;       ///< work of the hand on the loop since the force began, never falling
  double energy_out_J = 0.0;      ///< and of the loop on the hand
  double injected_J = 0.0;        ///< what of it came from nowhere, net of the device's friction
  std::array<double, 6> F_out{};  ///< about the point and in the axes the profile names

  // What it cost
  std::int64_t wrench_ready_ns = 0;        ///< monotonic time at which the wrench was ready, before limits
  std::int64_t wake_latency_ns = 0;        ///< from the time the tick was due to its start
  std::array<std::int64_t, 5> stage_ns{};  ///< read, projection, wrench, limits, write
};

}  // namespace wrenchd
