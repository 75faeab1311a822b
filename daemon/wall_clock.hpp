// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/clock.hpp"

namespace wrenchd {

/// The machine's monotonic clock, slept on to absolute times, so that no drift adds up.
class WallClock final : public Clock {
 public:
  TimePoint now() const noexcept override;
  void sleep_until(TimePoint t) noexcept override;
  Duration time_suspended() const noexcept override;
};

}  // namespace wrenchd
