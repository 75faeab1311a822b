// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <cstddef>
#include <future>
#include <memory>
#include <thread>
#include <vector>

#include <sys/types.h>

#include "core/clock.hpp"
#include "core/fault.hpp"
#include "daemon/realtime.hpp"
#include "daemon/servo/two_loops.hpp"

namespace wrenchd {

/// A servo loop that a real-time thread ticks. The destructor calls join(). Not RT-safe.
class RunningLoop {
 public:
  RunningLoop() = default;
  virtual ~RunningLoop() = default;
  RunningLoop(const RunningLoop&) = delete;
  RunningLoop& operator=(const RunningLoop&) = delete;

  /// Kernel thread id of the servo thread.
  virtual pid_t thread() const = 0;
  /// Returns true if the loop has ended because its device was lost.
  virtual bool ended() const = 0;
  /// Ends the loop: the force fades out and the hand is released. Returns the fault that ended it. Waits.
  virtual Fault join() noexcept = 0;
};

/// Starts a thread that ticks this loop alone, and logs what the kernel grants. Throws RealtimeError if real
/// time is required and the kernel denies it. Loop and clock must outlive the result.
std::unique_ptr<RunningLoop> start_servo_thread(const ServoSettings& settings, ServoLoop& loop, Clock& clock);

/// The servo thread of two hands. It runs from construction to destruction, with and without loops. Not
/// RT-safe.
class TwoHandThread {
 public:
  /// Logs what the kernel grants. Throws RealtimeError as start_servo_thread(). The clock must outlive this
  /// object.
  TwoHandThread(const ServoSettings& settings, Clock& clock);
  /// Precondition: no loop runs.
  ~TwoHandThread();
  TwoHandThread(const TwoHandThread&) = delete;
  TwoHandThread& operator=(const TwoHandThread&) = delete;

  /// Ticks the loop of this hand until its device is lost or the result is joined. Precondition: no loop of
  /// this hand runs. The loop must outlive the result.
  std::unique_ptr<RunningLoop> run(std::size_t hand, ServoLoop& loop);

 private:
  TwoLoops loops_;
  std::promise<std::vector<RealtimeGrant>> prepared_;
  std::atomic<bool> stop_{false};
  std::atomic<pid_t> id_{0};
  std::thread thread_;  ///< last member: it uses all of the above
};

}  // namespace wrenchd
