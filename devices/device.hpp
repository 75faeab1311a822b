// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "core/fault.hpp"
#include "core/spatial.hpp"

namespace wrenchd {

/// The newest thing a device said. Frames: B = device base, H = handle point.
struct DeviceSample {
  Pose X_BH;   ///< handle in the base
  Twist V_BH;  ///< of the handle point, in base axes; zero where the device does not report it
  double device_time_s = 0.0;      ///< the device's own clock, unwrapped
  std::uint64_t sequence = 0;      ///< of the report, unwrapped
  std::uint64_t acknowledged = 0;  ///< sequence of the last command the device took, unwrapped
  TimePoint arrived{};             ///< when the newest report reached the host
  std::uint32_t superseded = 0;    ///< older reports drained together with this one
  std::uint32_t missing = 0;       ///< reports lost since the last sample, by sequence number
  std::uint32_t rejected =
      0;  ///< reports dropped in this read: wrong id, length or checksum, backward or duplicate sequence
  std::uint32_t repeated = 0;  ///< of these, the ones with a backward or duplicate sequence
  std::uint32_t buttons = 0;   ///< bit mask
  bool fresh = false;          ///< a new report arrived since the last read
  bool motors_on = false;
  bool watchdog_tripped = false;
  bool homed = true;               ///< the encoders know where they are; until then no sample is fresh
  DofMask sensed_dofs = kAllDofs;  ///< whose motion the device reports; it stays put along the others
  DofMask driven_dofs = kAllDofs;  ///< along which its motors push
  DofMask dropped_dofs = kNoDof;   ///< components of the last wrench that were not 0 and have no motor
  Fault fault = Fault::none;       ///< what is wrong with it; the pose is the last good one then
};

/// The device contract. A device is opened and closed by an ordinary thread; between the two only the servo
/// thread speaks with it, and none of these calls may wait, lock, allocate or throw.
class Device {
 public:
  virtual ~Device() = default;

  /// Throws std::runtime_error that names the device and the cure.
  virtual void open() = 0;
  /// Drains what has arrived and returns the newest sample. RT safe.
  virtual DeviceSample read_newest(TimePoint now) noexcept = 0;
  /// Where the world holds the handle, in the base: the handle with the tool where the world allows it.
  /// Nothing: that is not known. A device whose pose is steered keeps near it; one with a handle of its own
  /// does not care. RT safe.
  virtual void set_proxy_pose(const std::optional<Pose>& /*X_BG*/) noexcept {}
  /// Sends one wrench, on the hand, about the point and in the axes the profile names. RT safe.
  virtual Fault write(TimePoint now, const Wrench& F, bool motors_on) noexcept = 0;
  /// The number of the last command that was sent, as DeviceSample::acknowledged counts them. RT safe.
  virtual std::uint64_t commands_sent() const noexcept { return 0; }
  /// Sends zero wrench with the motors off, several times; works in every state and never fails. RT safe.
  virtual void release(TimePoint now) noexcept = 0;
  /// Sleeps until a report is waiting or the deadline has passed.
  virtual void wait_readable(TimePoint deadline) noexcept = 0;
  virtual void close() noexcept = 0;
};

}  // namespace wrenchd
