// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/realtime_watch.hpp"

#include <sched.h>

namespace wrenchd {
namespace {

/// Returns the SCHED_FIFO priority of a thread, 0 for another policy, nothing if the thread does not exist.
/// Asks the kernel, because pthread_getschedparam() returns the value that this process set last.
std::optional<int> fifo_priority(pid_t thread) noexcept {
  const int policy = sched_getscheduler(thread);
  sched_param param{};
  if (policy < 0 || sched_getparam(thread, &param) != 0) return {};
  return (policy & ~SCHED_RESET_ON_FORK) == SCHED_FIFO ? param.sched_priority : 0;
}

}  // namespace

RealtimeWatch::RealtimeWatch(pid_t thread) noexcept
    : thread_(thread), granted_priority_(fifo_priority(thread).value_or(0)) {}

std::optional<RealtimeWatch::Change> RealtimeWatch::check() {
  const std::optional<int> priority = fifo_priority(thread_);
  if (!priority || (*priority < granted_priority_) == lost_) return {};
  lost_ = !lost_;
  const std::string granted = "SCHED_FIFO priority " + std::to_string(granted_priority_);
  if (!lost_) return Change{false, "the servo thread has " + granted + " again"};
  return Change{true, "another process lowered the servo thread from " + granted + " to " +
                          (*priority > 0 ? "priority " + std::to_string(*priority) : "an ordinary thread") +
                          "; restore it with: chrt -f -p " + std::to_string(granted_priority_) + " " +
                          std::to_string(thread_)};
}

}  // namespace wrenchd
