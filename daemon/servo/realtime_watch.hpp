// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include <sys/types.h>

namespace wrenchd {

/// Looks whether the servo thread still has the priority that it was granted. Whoever may can take it away
/// while the loop runs (chrt, a daemon that demotes what it finds too greedy), and the loop itself would only
/// see later and later ticks. For an ordinary thread; not RT safe.
class RealtimeWatch {
 public:
  /// thread: the kernel's number of it. What it has now is what it was granted.
  explicit RealtimeWatch(pid_t thread) noexcept;

  struct Change {
    bool lost;            ///< else it is back
    std::string message;  ///< what happened, and the cure
  };
  /// What became of it since the last look; nothing: nothing, also where there is no such thread any more, or
  /// where it never had a priority to lose.
  std::optional<Change> check();

 private:
  pid_t thread_;
  int granted_priority_;  ///< SCHED_FIFO priority; 0: none
  bool lost_ = false;
};

}  // namespace wrenchd
