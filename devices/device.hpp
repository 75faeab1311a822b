// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "core/fault.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// Newest state of a device. Frames: B = device base, H = handle frame.
struct DeviceSample {
  Pose X_BH;                   ///< handle pose
  Twist V_BH;                  ///< velocity of the handle point, in B: reported by the device or estimated
  double device_time_s = 0.0;  ///< time of the device clock, unwrapped
  std::uint64_t sequence = 0;  ///< sequence number of the report, unwrapped
  /// Sequence number of the last command that the device accepted, unwrapped.
  std::uint64_t acknowledged = 0;
  TimePoint arrived{};           ///< time at which the newest report reached the host
  std::uint32_t superseded = 0;  ///< older reports that were read together with the newest one
  std::uint32_t missing = 0;     ///< reports lost since the previous sample, from the sequence numbers
  std::uint32_t rejected = 0;    ///< reports dropped in this read: wrong id, length or checksum, or a
                                 ///< decreasing or repeated sequence
  std::uint32_t repeated = 0;    ///< reports among `rejected` with a decreasing or repeated sequence
  std::uint32_t buttons = 0;     ///< pressed buttons, as a bit mask
  bool fresh = false;            ///< true if a new report arrived since the previous read
  bool motors_on = false;
  bool watchdog_tripped = false;
  bool homed = true;  ///< true if the encoders have found their zero; until then no sample is fresh
  DofMask sensed_dofs = kAllDofs;  ///< degrees of freedom whose motion the device reports; the pose is
                                   ///< constant along the others
  /// Degrees of freedom whose velocity wrenchd estimates from the poses; the device reports the others.
  DofMask estimated_velocity_dofs = kNoDof;
  DofMask driven_dofs = kAllDofs;  ///< degrees of freedom with a motor
  /// Nonzero components of the last wrench without a motor; the device did not apply them.
  DofMask dropped_dofs = kNoDof;
  Fault fault = Fault::none;  ///< fault found in this read; the pose is then the last valid one
};

/// Contract of a device. A normal thread opens and closes the device. Between open() and close() only the
/// servo thread uses it. The functions marked RT-safe do not wait, lock, allocate or throw.
class Device {
 public:
  virtual ~Device() = default;

  /// Opens the device. Throws std::runtime_error with the device and the remedy. Not RT-safe: may take
  /// seconds.
  virtual void open() = 0;
  /// Reads all waiting reports and returns the newest sample. RT-safe.
  virtual DeviceSample read_newest(TimePoint now) noexcept = 0;
  /// Sets the pose of the handle, in B, at which the proxy is. Without a value the proxy pose is unknown. A
  /// device with a steered pose limits its distance to the proxy; other devices ignore it. RT-safe.
  virtual void set_proxy_pose(const std::optional<Pose>& /*X_BQ*/) noexcept {}
  /// Sends one wrench on the hand, about the point and in the axes that the profile names. Returns the fault
  /// of the transmission. RT-safe.
  virtual Fault write(TimePoint now, const Wrench& F, bool motors_on) noexcept = 0;
  /// Returns the sequence number of the last command sent, in the numbering of DeviceSample::acknowledged.
  /// RT-safe.
  virtual std::uint64_t commands_sent() const noexcept { return 0; }
  /// Sends a zero wrench with the motors off, several times. Works in every state and never fails. RT-safe.
  virtual void release(TimePoint now) noexcept = 0;
  /// Sleeps until a report is waiting or the deadline has passed. RT-safe except for the intended sleep.
  virtual void wait_readable(TimePoint deadline) noexcept = 0;
  virtual void close() noexcept = 0;
};

}  // namespace wrenchd
