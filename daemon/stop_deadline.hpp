// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <thread>

namespace wrenchd {

class ProcessSignals;

/// Ends the process if it does not end by itself in time after a request to end, because a thread builds a
/// scene of millions of triangles, reads a file that never comes or waits for a stalled program. Releases the
/// hand first, if that has not happened. Not RT-safe: runs a thread.
class StopDeadline {
 public:
  /// before_exit: runs before the process ends, for at most a fraction of a second. Both must outlive this
  /// object.
  StopDeadline(const ProcessSignals& signals, std::function<void()> before_exit);
  /// The process ends by itself.
  ~StopDeadline();
  StopDeadline(const StopDeadline&) = delete;
  StopDeadline& operator=(const StopDeadline&) = delete;

  /// The run has ended: the time until the deadline starts, if no signal has started it.
  /// exit_code: of the process, if the deadline ends it.
  void start(int exit_code) noexcept {
    exit_code_.store(exit_code);
    started_.store(true);
  }

  /// While this object lives, the time limit is kMaxRecording in place of kMaxStop: stored ticks are worth
  /// the wait for a slow disk.
  class RecordingTime {
   public:
    explicit RecordingTime(StopDeadline& deadline) noexcept : deadline_(deadline) {
      deadline_.recordings_.fetch_add(1);
    }
    ~RecordingTime() { deadline_.recordings_.fetch_sub(1); }
    RecordingTime(const RecordingTime&) = delete;
    RecordingTime& operator=(const RecordingTime&) = delete;

   private:
    StopDeadline& deadline_;
  };

  static constexpr auto kMaxStop = std::chrono::milliseconds(1400);
  /// Below TimeoutStopSec= of the service.
  static constexpr auto kMaxRecording = std::chrono::milliseconds(7000);

 private:
  void run(const std::stop_token& stop);

  const ProcessSignals& signals_;
  std::function<void()> before_exit_;
  std::atomic<bool> started_{false};
  std::atomic<int> exit_code_{0};
  std::atomic<int> recordings_{0};  ///< number of RecordingTime objects
  std::jthread thread_;             ///< last member: it uses the members above
};

}  // namespace wrenchd
