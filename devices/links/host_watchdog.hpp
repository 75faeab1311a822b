// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "devices/links/packet_queue.hpp"
#include "devices/report_codec.hpp"

namespace wrenchd {

/// Watchdog of the servo loop, run by the writer thread of a link. If the loop hangs while the device applies
/// a wrench, the watchdog sends a zero wrench with the motors off. A hanging loop cannot release the device,
/// and the device's own watchdog may take half a second.
///
/// The watchdog is active only timeout a nonzero wrench. The loop sends zeros before an intended silence, for
/// example in the self-test of the device's watchdog. After its zero commands the watchdog is inactive until
/// the loop sends a nonzero wrench again. Its commands use the next sequence numbers of the loop. A loop that
/// resumes therefore loses the same number of its own commands; these are zero too (core/transitions.hpp: a
/// late tick).
///
/// Used only by the writer thread. All members except the constructors are RT-safe.
class HostWatchdog {
 public:
  /// Makes a watchdog that never sends.
  HostWatchdog() noexcept = default;
  /// timeout: timeout since the last command of the loop. For a device without motors the watchdog never
  /// sends. Not RT-safe: allocates.
  HostWatchdog(const DeviceProfile& profile, Duration timeout);

  /// Processes a report that the loop sent at `now`. RT-safe.
  void feed(TimePoint now, const Packet& packet) noexcept;
  /// Returns the time at which the watchdog sends next if the loop sends nothing before; TimePoint::max() if
  /// it will not send. RT-safe.
  TimePoint due() const noexcept { return due_; }
  /// Writes the zero command to `packet` if it is due, and returns true. Returns false otherwise. RT-safe.
  bool send_zero(TimePoint now, Packet& packet) noexcept;

  /// Number of zero commands, so that the loss of one has no effect.
  static constexpr unsigned kZeroReports = 3;
  static constexpr Duration kZeroInterval = std::chrono::milliseconds(1);

 private:
  std::optional<WrenchReportLayout> layout_;
  Duration timeout_{};
  WrenchReport last_report_;  ///< last command of the loop
  unsigned zeros_sent_ = 0;   ///< zero commands sent since last_report_
  TimePoint due_ = TimePoint::max();
};

}  // namespace wrenchd
