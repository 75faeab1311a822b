// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>

namespace wrenchd {

/// Monotonic time. In virtual time the epoch is the start of the run.
using TimePoint = std::chrono::steady_clock::time_point;
using Duration = std::chrono::nanoseconds;

inline double seconds(Duration d) noexcept {
  return std::chrono::duration<double>(d).count();
}
inline Duration from_seconds(double s) noexcept {
  return std::chrono::duration_cast<Duration>(std::chrono::duration<double>(s));
}

/// Where the servo loop gets its time from: the machine's monotonic clock (daemon/wall_clock.hpp), or a clock
/// that tests turn by hand.
class Clock {
 public:
  virtual ~Clock() = default;
  virtual TimePoint now() const noexcept = 0;  ///< RT safe.
  virtual void sleep_until(TimePoint t) noexcept = 0;
  /// How long the machine has slept since it was switched on: time that now() leaves out. RT safe.
  virtual Duration time_suspended() const noexcept { return {}; }
};

/// Time that passes only when somebody sleeps: hours in seconds, and every run the same. RT safe.
class VirtualClock final : public Clock {
 public:
  TimePoint now() const noexcept override { return now_; }
  void sleep_until(TimePoint t) noexcept override {
    if (t > now_) now_ = t;
  }
  Duration time_suspended() const noexcept override { return time_suspended_; }
  /// The machine goes to sleep, and wakes up.
  void suspend_for(Duration d) noexcept { time_suspended_ += d; }

 private:
  TimePoint now_{};
  Duration time_suspended_{};
};

}  // namespace wrenchd
