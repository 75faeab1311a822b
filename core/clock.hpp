// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>

namespace wrenchd {

/// Point in monotonic time. In virtual time the epoch is the start of the run.
using TimePoint = std::chrono::steady_clock::time_point;
using Duration = std::chrono::nanoseconds;

inline double seconds(Duration d) noexcept {
  return std::chrono::duration<double>(d).count();
}
inline Duration from_seconds(double s) noexcept {
  return std::chrono::duration_cast<Duration>(std::chrono::duration<double>(s));
}

/// Time source of the servo loop: the machine's monotonic clock (daemon/wall_clock.hpp), or a clock that a
/// test advances.
class Clock {
 public:
  virtual ~Clock() = default;
  virtual TimePoint now() const noexcept = 0;  ///< current monotonic time. RT-safe.
  virtual void sleep_until(TimePoint t) noexcept = 0;
  /// Total time that the machine has been suspended since boot. now() does not count this time. RT-safe.
  virtual Duration time_suspended() const noexcept { return {}; }
};

/// Clock that advances only in sleep_until(). Hours run in seconds, and every run is the same. RT-safe.
class VirtualClock final : public Clock {
 public:
  TimePoint now() const noexcept override { return now_; }
  void sleep_until(TimePoint t) noexcept override {
    if (t > now_) now_ = t;
  }

 private:
  TimePoint now_{};
};

}  // namespace wrenchd
