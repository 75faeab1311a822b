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

/// CLOCK_BOOTTIME advances while the machine is suspended, CLOCK_MONOTONIC does not. Both are read without a
/// system call.
Duration WallClock::time_suspended() const noexcept {
  timespec boot{}, monotonic{};
  clock_gettime(CLOCK_BOOTTIME, &boot);
  clock_gettime(CLOCK_MONOTONIC, &monotonic);
  return std::chrono::seconds(boot.tv_sec - monotonic.tv_sec) + Duration(boot.tv_nsec - monotonic.tv_nsec);
}

}  // namespace wrenchd
