// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

namespace wrenchd {

/// Runs tasks in order on a thread of its own, so that the control thread does not block. An exception of
/// a task is logged. Not RT-safe: allocates.
class WorkerQueue {
 public:
  WorkerQueue();
  /// Waits for the running task, and drops the queued tasks.
  ~WorkerQueue();

  /// Queues a task. Returns false if kMaxQueued tasks are queued. Any thread; does not wait for a task.
  bool post(std::function<void()> task);

  static constexpr std::size_t kMaxQueued = 8;

 private:
  void run(const std::stop_token& stop);

  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<std::function<void()>> queue_;
  std::jthread thread_;  ///< last member: it uses the members above
};

}  // namespace wrenchd
