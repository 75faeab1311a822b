// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include <sys/types.h>

namespace wrenchd {

/// Detects that another process lowered the real-time priority of the servo thread, for example with chrt.
/// The loop itself would only see late ticks. For an ordinary thread.
class RealtimeWatch {
 public:
  /// thread: kernel thread id of the servo thread. Takes its present priority as the granted one. Not
  /// RT-safe: system calls.
  explicit RealtimeWatch(pid_t thread) noexcept;

  struct Change {
    bool lost;            ///< True if the priority was lowered, false if it was restored.
    std::string message;  ///< What happened, and the command that restores the priority.
  };
  /// Returns the change since the last check. Returns nothing if nothing changed, if the thread ended, or if
  /// it never had a real-time priority. Not RT-safe: system calls, allocates.
  std::optional<Change> check();

 private:
  pid_t thread_;
  int granted_priority_;  ///< SCHED_FIFO priority at construction; 0 if the thread had none.
  bool lost_ = false;     ///< True while the priority is below granted_priority_.
};

}  // namespace wrenchd
