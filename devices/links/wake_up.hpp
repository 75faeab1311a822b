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

/// Sleeps until the file is ready for `events` (POLLIN, ...), has an error, or the deadline has passed, to
/// the nanosecond as far as the kernel's timers go. Returns what the file is ready for, 0 for nothing. RT
/// safe but for the sleep.
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

/// Wakes a thread from another that must not wait or lock: an eventfd. Wake-ups before the sleep are kept,
/// any number of them as one.
class WakeUp {
 public:
  /// Throws std::system_error where the system has no file descriptor left.
  WakeUp() : fd_(eventfd(0, EFD_CLOEXEC)) {
    if (fd_ < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
  }
  ~WakeUp() { ::close(fd_); }
  WakeUp(const WakeUp&) = delete;
  WakeUp& operator=(const WakeUp&) = delete;

  /// RT safe.
  void wake() noexcept { eventfd_write(fd_, 1); }
  /// Sleeps until the next wake-up and takes it; at once where one waits.
  void wait() noexcept {
    eventfd_t ignored = 0;
    eventfd_read(fd_, &ignored);
  }
  /// The same, until the deadline at most.
  void wait_until(TimePoint deadline) noexcept {
    if (deadline == TimePoint::max() || wait_for_fd(fd_, POLLIN, deadline) != 0) wait();
  }
  /// Readable while a wake-up waits.
  int fd() const noexcept { return fd_; }

 private:
  int fd_;
};

}  // namespace wrenchd
