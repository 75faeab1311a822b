// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "core/clock.hpp"
#include "core/fault.hpp"

namespace wrenchd {

/// Detects a device that does not accept commands.
class WriteWatch {
 public:
  /// Returns device_lost at once, write_blocked after kBlockedWrite, write_failed after kFailedWrite of
  /// failed writes in a row. written: result of the write of this tick. RT-safe.
  FaultSet check(Fault written, TimePoint now) noexcept;
  /// Forgets earlier failed writes. RT-safe.
  void reset() noexcept { blocked_since_.reset(); }

 private:
  std::optional<TimePoint>
      blocked_since_;  ///< Time of the first failed write in a row; empty after a success.
};

}  // namespace wrenchd
