// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/clock.hpp"
#include "core/pose.hpp"

namespace wrenchd {

/// What a read or write on a link came to.
enum class LinkStatus : std::uint8_t {
  ok,            ///< a report was transferred
  not_ready,     ///< nothing to read now, or no room to write now
  disconnected,  ///< the device is not there any more; only close() makes sense
};

struct LinkRead {
  LinkStatus status = LinkStatus::not_ready;
  std::size_t length = 0;  ///< of the report, even where it was longer than the buffer (then it was cut)
  TimePoint arrived{};     ///< when the report reached the host
};

/// A byte transport that keeps report boundaries: report in, report out. It knows nothing of their content.
/// The simulated device stands behind one (devices/links/loopback_link.hpp); USB transports are others.
class ReportLink {
 public:
  virtual ~ReportLink() = default;

  /// Opens the transport. Throws std::runtime_error that names the device and the cure. Not RT safe.
  virtual void open() = 0;
  /// Takes the oldest waiting report. RT safe; never waits.
  virtual LinkRead read(TimePoint now, std::span<std::uint8_t> buffer) noexcept = 0;
  /// Hands one report over. RT safe; never waits.
  virtual LinkStatus write(TimePoint now, std::span<const std::uint8_t> report) noexcept = 0;
  /// Sleeps until a report is waiting or the deadline has passed. RT safe but for the sleep it is there for.
  virtual void wait_readable(TimePoint deadline) noexcept = 0;
  /// Where a pose that is steered has come to, in the base: what whoever steers sees on the screen. Only a
  /// simulated hand looks. RT safe.
  virtual void show_pose(TimePoint /*now*/, const Pose& /*X_BH*/) noexcept {}
  /// Closes the transport; harmless when closed.
  virtual void close() noexcept = 0;
};

}  // namespace wrenchd
