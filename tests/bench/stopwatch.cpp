// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/bench/stopwatch.hpp"

#include <algorithm>
#include <chrono>
#include <limits>

#include <sched.h>

namespace wrenchd::bench {

CounterScale calibrate_counter() {
  using Clock = std::chrono::steady_clock;
  CounterScale scale;
  const auto began = Clock::now();
  const std::int64_t first = counter();
  while (Clock::now() - began < std::chrono::milliseconds(100)) continue;
  const std::int64_t last = counter();
  const std::chrono::duration<double, std::nano> passed = Clock::now() - began;
  scale.ns_per_count = passed.count() / static_cast<double>(last - first);

  scale.overhead_counts = std::numeric_limits<std::int64_t>::max();
  for (int i = 0; i < 10000; ++i) {
    const std::int64_t before = counter();
    scale.overhead_counts = std::min(scale.overhead_counts, counter() - before);
  }
  return scale;
}

bool pinned_to_one_core() {
  cpu_set_t cores;
  CPU_ZERO(&cores);
  return sched_getaffinity(0, sizeof cores, &cores) == 0 && CPU_COUNT(&cores) == 1;
}

}  // namespace wrenchd::bench
