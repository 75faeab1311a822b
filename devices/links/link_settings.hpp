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

/// A loop of 1 kHz that is later than that is a late one by its own rules, too (core/watch_limits.hpp).
inline constexpr Duration kHostWatchdogTimeout = std::chrono::milliseconds(6);

/// What a USB link is told beside the device.
struct LinkSettings {
  /// A write that makes no progress for this long is told to the servo thread as a failed one. Writes end
  /// within a frame or two of 1 ms on a device that works; one that is longer than a few is stuck.
  Duration write_deadline = std::chrono::milliseconds(4);
  /// How long close() waits at most for the last report to be written.
  Duration close_timeout = std::chrono::milliseconds(500);
  /// SCHED_FIFO priority of the link's own thread; 0: an ordinary thread. That of the servo thread is best:
  /// the command goes out as soon as the servo thread sleeps, and neither cuts the other short.
  int priority = 0;
  /// Speaks for a loop that is stuck.
  HostWatchdog host_watchdog = {};
  /// Bytes of the longest input report, where it is longer than one packet. Only libusb must know it.
  std::size_t max_report_bytes = 0;

  // What follows only libusb must know.

  /// Endpoints; 0: the first of the interface.
  std::uint8_t in_endpoint = 0, out_endpoint = 0;
  /// At the start of each packet in, not part of a report: a serial chip's modem status.
  std::size_t prefix_bytes = 0;
  /// Where the device is a serial chip: what is done with it when it is opened, before reports flow. It may
  /// wait and throw.
  std::function<void(SerialChip&)> start_serial = {};
  /// How reports are found in what a serial chip sends.
  StreamFramer::Frame frame = {};
};

/// What the profile says of a link; the rest as above. silent_after: from when on a loop that pushes and says
/// nothing is spoken for; it has to be longer than the loop ever is silent. Not RT safe.
LinkSettings link_settings(const DeviceProfile& profile, Duration silent_after = kHostWatchdogTimeout);

}  // namespace wrenchd
