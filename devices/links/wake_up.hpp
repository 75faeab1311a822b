// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cerrno>
#include <cstdint>
#include <ctime>
#include <system_error>

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "core/clock.hpp"

namespace wrenchd {

/// Sleeps until the file descriptor is ready for `events` (POLLIN, ...), has an error, or the deadline has
/// passed, with the resolution of the kernel timers. Returns the events that are ready; 0 on timeout. RT-safe
/// except for the intended sleep.
inline short wait_for_fd(int file, short events, TimePoint deadline) noexcept {
  for (;;) {
    const Duration left = deadline - std::chrono::steady_clock::now();
    const Duration wait = left > Duration::zero() ? left : Duration::zero();
    timespec timeout{};
    timeout.tv_sec = wait / std::chrono::seconds(1);
    timeout.tv_nsec = (wait % std::chrono::seconds(1)).count();
    pollfd ready{file, events, 0};
    const int n = ppoll(&ready, 1, &timeout, nullptr);
    if (n > 0) return ready.revents;
    if (n == 0 || errno != EINTR) return 0;
  }
}

/// Wakes one thread from another thread that must not wait or lock: an eventfd. Wake-ups before the sleep are
/// kept; several count as one.
class WakeUp {
 public:
  /// Throws std::system_error if no file descriptor is available. Not RT-safe: system call.
  WakeUp() : fd_(eventfd(0, EFD_CLOEXEC)) {
    if (fd_ < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
  }
  ~WakeUp() { ::close(fd_); }
  WakeUp(const WakeUp&) = delete;
  WakeUp& operator=(const WakeUp&) = delete;

  /// Wakes the waiting thread. RT-safe.
  void wake() noexcept { eventfd_write(fd_, 1); }
  /// Sleeps until the next wake-up and consumes it. Returns at once if one is pending.
  void wait() noexcept {
    eventfd_t ignored = 0;
    eventfd_read(fd_, &ignored);
  }
  /// Sleeps until the next wake-up, at most until the deadline, and consumes the wake-up.
  void wait_until(TimePoint deadline) noexcept {
    if (deadline == TimePoint::max() || wait_for_fd(fd_, POLLIN, deadline) != 0) wait();
  }
  /// File descriptor that is readable while a wake-up is pending.
  int fd() const noexcept { return fd_; }

 private:
  int fd_;
};

}  // namespace wrenchd
