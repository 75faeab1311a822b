// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "config/settings.hpp"

namespace wrenchd {

/// One thing asked of the kernel, and what came of it.
struct RealtimeGrant {
  std::string request;  ///< "SCHED_FIFO priority 45"
  bool granted = false;
  std::string cure;  ///< where refused: why, and what to do
};

/// Refused under realtime = "required".
class RealtimeError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Locks the process's memory, present and future, and keeps the heap from giving memory back. To be called
/// once, before the servo thread starts. Throws RealtimeError where it is required and refused.
std::vector<RealtimeGrant> lock_memory(Realtime mode);

/// Makes the calling thread the servo thread: SCHED_FIFO, affinity, and a stack whose pages are there. Throws
/// RealtimeError where it is required and refused.
std::vector<RealtimeGrant> prepare_servo_thread(const ServoSettings& settings);

}  // namespace wrenchd
