// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>

#include "core/clock.hpp"
#include "core/fault.hpp"
#include "daemon/servo/authority.hpp"
#include "daemon/servo/write_watch.hpp"
#include "devices/device.hpp"

namespace wrenchd {

/// What the device says in one tick.
struct DeviceReading {
  DeviceSample sample;
  std::uint64_t last_command_sent = 0;  ///< Number of the last command sent before this reading.
};

/// What went to the device in one tick.
struct Written {
  bool sent = false;  ///< False if the authority kept the loop silent.
  Wrench F;           ///< About the point that DeviceProfile::wrench_point names; zero if nothing was sent.
  bool motors_on = false;      ///< The last command sent, in this tick or before, says motors on.
  Fault result = Fault::none;  ///< Result of the write.
  FaultSet faults = 0;         ///< What the results of this write and of those before it amount to.

  bool device_lost() const noexcept { return (faults & bit(Fault::device_lost)) != 0; }
};

/// The servo loop's side of a device: reads, writes and releases. All members but wait_readable() are
/// RT-safe.
class DevicePort {
 public:
  /// The device is kept by reference, and is open.
  explicit DevicePort(Device& device) noexcept : device_(device) {}

  DeviceReading read(TimePoint now) noexcept;

  /// Sends a wrench, if the authority lets the loop send anything. If the device has rejected writes for too
  /// long, it sends zero with the motors off at once: a device that listens again must not find an old
  /// wrench. X_BH_held: pose in B at which the world holds the handle, if it is known.
  Written write(TimePoint now, const Wrench& F, const Authority& authority,
                const std::optional<Pose>& X_BH_held) noexcept;

  /// Result of the last write.
  const Written& last() const noexcept { return last_; }

  /// Zero wrench, motors off, whatever the state. Harmless when called again.
  Written release(TimePoint now) noexcept;

  /// Sleeps until a report arrives or the deadline has passed. Not RT-safe: blocks.
  void wait_readable(TimePoint deadline) noexcept { device_.wait_readable(deadline); }

 private:
  Device& device_;
  WriteWatch write_watch_;
  Written last_;
};

}  // namespace wrenchd
