// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/bench/stopwatch.hpp"

#include <algorithm>
#include <chrono>
#include <limits>

#include <sched.h>

namespace wrenchd::bench {

TickScale calibrate() {
  using Clock = std::chrono::steady_clock;
  TickScale scale;
  const auto began = Clock::now();
  const std::int64_t first = ticks();
  while (Clock::now() - began < std::chrono::milliseconds(100)) continue;
  const std::int64_t last = ticks();
  const std::chrono::duration<double, std::nano> passed = Clock::now() - began;
  scale.ns_per_tick = passed.count() / static_cast<double>(last - first);

  scale.empty_ticks = std::numeric_limits<std::int64_t>::max();
  for (int i = 0; i < 10000; ++i) {
    const std::int64_t before = ticks();
    scale.empty_ticks = std::min(scale.empty_ticks, ticks() - before);
  }
  return scale;
}

bool pinned_to_one_core() {
  cpu_set_t cores;
  CPU_ZERO(&cores);
  return sched_getaffinity(0, sizeof cores, &cores) == 0 && CPU_COUNT(&cores) == 1;
}

}  // namespace wrenchd::bench
