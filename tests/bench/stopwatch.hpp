// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#if defined(__x86_64__)
#include <x86intrin.h>
#else
#include <chrono>
#endif

namespace wrenchd::bench {

/// A clock that is cheap enough for calls of a tenth of a microsecond: the time-stamp counter where there is
/// one. The fences keep what is timed from running across a reading.
inline std::int64_t counter() noexcept {
#if defined(__x86_64__)
  _mm_lfence();
  const auto now = static_cast<std::int64_t>(__rdtsc());
  _mm_lfence();
  return now;
#else
  return std::chrono::steady_clock::now().time_since_epoch().count();
#endif
}

/// What ticks() counts, found out once.
struct CounterScale {
  double ns_per_count = 1.0;
  std::int64_t overhead_counts = 0;  ///< least that two readings with nothing between them are apart

  /// Of the time between two readings, less what the readings themselves take.
  double ns(std::int64_t elapsed_ticks) const noexcept {
    return elapsed_ticks <= overhead_counts
               ? 0.0
               : static_cast<double>(elapsed_ticks - overhead_counts) * ns_per_count;
  }
};

/// Takes a tenth of a second.
CounterScale calibrate_counter();

/// Is this process kept to one core? Times are calmer then.
bool pinned_to_one_core();

}  // namespace wrenchd::bench
