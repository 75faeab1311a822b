// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>

#include "core/clock.hpp"
#include "core/device_profile.hpp"
#include "devices/links/packet_queue.hpp"
#include "devices/report_codec.hpp"

namespace wrenchd {

/// What the writer of a link says in the place of a servo loop that has fallen silent while it pushed: zero
/// wrench, motors off. A loop that is stuck while its process lives cannot release the hand itself, and the
/// device's own watchdog may take half a second.
///
/// It speaks of nothing but wrenches that push: a loop that is silent on purpose, as in the self-test that
/// wants to see the watchdog trip, sends zeros before. Once it has spoken it is silent until the loop pushes
/// anew. Its commands have the numbers that the loop's next ones will have, so a loop that comes back loses
/// as many of its own; it comes back with zeros (core/transitions.hpp: a late tick).
///
/// Belongs to the writer's thread. Neither allocates, locks nor throws.
class HostWatchdog {
 public:
  /// Never speaks.
  HostWatchdog() noexcept = default;
  /// after: silence of the loop until it is spoken for. Of a device without motors: never speaks.
  HostWatchdog(const DeviceProfile& profile, Duration after);

  /// The loop said that, now.
  void feed(TimePoint now, const Packet& packet) noexcept;
  /// When it is time to speak for the loop, if it says nothing until then; TimePoint::max() where there is
  /// nothing to say.
  TimePoint due() const noexcept { return due_; }
  /// What to say now, if it is time.
  bool send_zero(TimePoint now, Packet& packet) noexcept;

  /// Said so often, so that a lost one does not matter.
  static constexpr unsigned kZeroReports = 3;
  static constexpr Duration kZeroInterval = std::chrono::milliseconds(1);

 private:
  std::optional<WrenchReportLayout> layout_;
  Duration timeout_{};
  WrenchReport last_report_;  ///< the loop's
  unsigned zeros_sent_ = 0;   ///< since then
  TimePoint due_ = TimePoint::max();
};

}  // namespace wrenchd
