// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#if defined(__x86_64__)
#include <x86intrin.h>
#else
#include <chrono>
#endif

namespace wrenchd::bench {

/// Reads a clock that is cheap enough to time 0.1 us: the time-stamp counter where the processor has one. The
/// fences keep the timed instructions between the two readings.
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

/// Conversion of counter() to time, measured once.
struct CounterScale {
  double ns_per_count = 1.0;
  std::int64_t overhead_counts = 0;  ///< minimum difference of two consecutive readings

  /// Returns the time between two readings [ns], less the cost of the readings themselves.
  double ns(std::int64_t elapsed_ticks) const noexcept {
    return elapsed_ticks <= overhead_counts
               ? 0.0
               : static_cast<double>(elapsed_ticks - overhead_counts) * ns_per_count;
  }
};

/// Measures the scale. Takes 0.1 s.
CounterScale calibrate_counter();

/// Returns true if the process may use only one core. Times are steadier then.
bool pinned_to_one_core();

}  // namespace wrenchd::bench
