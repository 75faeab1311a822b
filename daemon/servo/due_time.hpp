// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/clock.hpp"

namespace wrenchd {

/// Moves the due time of the next tick past `now`, by whole periods. Returns the number of ticks that this
/// skips: two ticks in a row on the same sample would compute the same wrench twice. RT-safe.
inline std::uint64_t skip_missed_ticks(TimePoint& due, Duration period, TimePoint now) noexcept {
  if (now <= due) return 0;
  const auto missed = (now - due) / period + 1;
  due += missed * period;
  return static_cast<std::uint64_t>(missed);
}

}  // namespace wrenchd
