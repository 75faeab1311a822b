// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/clock.hpp"

namespace wrenchd {

/// The monotonic clock of the machine. It sleeps until absolute times, so drift does not accumulate. now()
/// and time_suspended() are RT-safe. sleep_until() blocks until the time given.
class WallClock final : public Clock {
 public:
  TimePoint now() const noexcept override;
  void sleep_until(TimePoint t) noexcept override;
  Duration time_suspended() const noexcept override;
};

}  // namespace wrenchd
