// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/servo/realtime_watch.hpp"

#include <sched.h>

namespace wrenchd {
namespace {

/// SCHED_FIFO priority of a thread, 0 under another policy; nothing: there is no such thread. Asked of the
/// kernel: pthread_getschedparam() tells what the process itself set last.
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
  const std::optional<int> now = fifo_priority(thread_);
  if (!now || (*now < granted_priority_) == lost_) return {};
  lost_ = !lost_;
  const std::string granted = "SCHED_FIFO priority " + std::to_string(granted_priority_);
  if (!lost_) return Change{false, "the servo thread has its " + granted + " again"};
  return Change{true,
                "somebody took the servo thread's " + granted + " (" +
                    (*now > 0 ? "it is " + std::to_string(*now) + " now" : "it is an ordinary thread now") +
                    "); give it back with: chrt -f -p " + std::to_string(granted_priority_) + " " +
                    std::to_string(thread_)};
}

}  // namespace wrenchd
