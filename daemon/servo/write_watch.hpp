// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "core/clock.hpp"
#include "core/fault.hpp"

namespace wrenchd {

/// Looks whether the device takes what is written. RT safe.
class WriteWatch {
 public:
  /// written: what the write of this tick came to.
  FaultSet check(Fault written, TimePoint now) noexcept;
  void reset() noexcept { blocked_since_.reset(); }

 private:
  std::optional<TimePoint> blocked_since_;
};

}  // namespace wrenchd
