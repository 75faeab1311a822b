// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "config/settings.hpp"

namespace wrenchd {

/// One request to the kernel and its result.
struct RealtimeGrant {
  std::string request;   ///< "SCHED_FIFO priority 45"
  bool granted = false;  ///< false: the kernel denied the request
  std::string cure;      ///< if denied: the reason and what to do; else empty
};

/// The kernel denied a request and the configuration has realtime = "required".
class RealtimeError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Locks the present and future memory of the process, and keeps the heap from returning memory to the
/// kernel. Call it once, before the servo thread starts. Throws RealtimeError if `mode` is required and the
/// kernel denies the request. Not RT-safe: may take seconds.
std::vector<RealtimeGrant> lock_memory(Realtime mode);

/// Makes the calling thread the servo thread: SCHED_FIFO priority, CPU affinity, and a stack whose pages are
/// present. Throws RealtimeError if real time is required and the kernel denies a request. Not RT-safe:
/// allocates.
std::vector<RealtimeGrant> prepare_servo_thread(const ServoSettings& settings);

/// Logs each request and its result. Not RT-safe: logs.
void log_grants(const std::vector<RealtimeGrant>& grants);

}  // namespace wrenchd
