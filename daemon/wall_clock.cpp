// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/wall_clock.hpp"

#include <cerrno>
#include <ctime>

namespace wrenchd {

TimePoint WallClock::now() const noexcept {
  return std::chrono::steady_clock::now();
}

void WallClock::sleep_until(TimePoint t) noexcept {
  const auto ns = t.time_since_epoch().count();  // steady_clock is CLOCK_MONOTONIC on Linux
  timespec until{};
  until.tv_sec = ns / 1'000'000'000;
  until.tv_nsec = ns % 1'000'000'000;
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) continue;
}

}  // namespace wrenchd
