// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/clock.hpp"

namespace wrenchd {

/// Result of a read or write on a link.
enum class LinkStatus : std::uint8_t {
  ok,            ///< a report was transferred
  not_ready,     ///< read: no report waits; write: the link cannot take or has failed to write a report
  disconnected,  ///< the device is disconnected; only close() is valid
};

struct LinkRead {
  LinkStatus status = LinkStatus::not_ready;
  std::size_t length = 0;  ///< length of the report; if it exceeds the buffer, the report was truncated
  TimePoint arrived{};     ///< time at which the report reached the host
};

/// Transport of reports with their boundaries: one report in, one report out. It does not interpret their
/// content. LoopbackLink leads to an emulated device; other implementations are USB transports.
class ReportLink {
 public:
  virtual ~ReportLink() = default;

  /// Opens the transport. Throws std::runtime_error with the device and the remedy. Not RT-safe: may take
  /// seconds.
  virtual void open() = 0;
  /// Reads the oldest waiting report into `buffer`. Never waits. RT-safe.
  virtual LinkRead read(TimePoint now, std::span<std::uint8_t> buffer) noexcept = 0;
  /// Submits one report. Never waits. RT-safe.
  virtual LinkStatus write(TimePoint now, std::span<const std::uint8_t> report) noexcept = 0;
  /// Sleeps until a report is waiting or the deadline has passed. RT-safe except for the intended sleep.
  virtual void wait_readable(TimePoint deadline) noexcept = 0;
  /// Returns true if the report descriptor of the device declares this input report. False also if there is
  /// no descriptor. RT-safe.
  virtual bool declares(std::span<const std::uint8_t> /*report*/) const noexcept { return false; }
  /// Closes the transport; has no effect when closed. Not RT-safe: may wait for the last write.
  virtual void close() noexcept = 0;
};

}  // namespace wrenchd
