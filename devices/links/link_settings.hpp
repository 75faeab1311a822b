// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "devices/falcon_start.hpp"
#include "devices/links/host_watchdog.hpp"
#include "devices/links/stream_framer.hpp"

namespace wrenchd {

/// Default timeout of the host watchdog. A 1 kHz loop this late is also late by its own limits
/// (core/watch_limits.hpp).
inline constexpr Duration kHostWatchdogTimeout = std::chrono::milliseconds(6);

/// Settings of a link to a device.
struct LinkSettings {
  /// If a write makes no progress for this time, the link reports it to the servo thread as failed. A working
  /// device completes a write within one or two frames of 1 ms, so a write that takes a few frames is stuck.
  Duration write_deadline = std::chrono::milliseconds(4);
  /// Maximum time that close() waits for the last write.
  Duration close_timeout = std::chrono::milliseconds(500);
  /// SCHED_FIFO priority of the link's thread; 0: a normal thread. Use the priority of the servo thread: the
  /// command then leaves as soon as the servo thread sleeps, and neither thread preempts the other.
  int priority = 0;
  /// Sends zero commands if the servo loop hangs.
  HostWatchdog host_watchdog = {};
  /// Length of the longest input report in bytes, if it exceeds one USB packet. Only UsbLink uses it.
  std::size_t max_report_bytes = 0;

  // Only UsbLink uses the following settings.

  /// Endpoint addresses; 0: the first endpoint of the interface.
  std::uint8_t in_endpoint = 0, out_endpoint = 0;
  /// Bytes at the start of each IN packet that are not part of a report: modem status of a serial chip.
  std::size_t prefix_bytes = 0;
  /// Starts a device behind a serial chip. UsbLink calls it when it opens the device, before any report. It
  /// may wait and throw.
  std::function<void(SerialChip&)> start_serial = {};
  /// Format of the reports in the byte stream of a serial chip.
  StreamFramer::Frame frame = {};
};

/// Returns the link settings of a profile; the other settings keep their defaults. silent_after: timeout of
/// the host watchdog; it must exceed the longest normal pause between two commands of the loop. Not RT-safe:
/// allocates.
LinkSettings link_settings(const DeviceProfile& profile, Duration silent_after = kHostWatchdogTimeout);

}  // namespace wrenchd
