// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <thread>

#include <sys/types.h>

namespace wrenchd {

/// Runs tasks on a thread of its own, so that the control thread does not block. Users take turns: one task
/// of each user that has queued tasks, in the order of their last turns. A task must not throw: an exception
/// ends the process. Not RT-safe: allocates.
class WorkerQueue {
 public:
  WorkerQueue();
  /// Waits for the running task, and drops the queued tasks.
  ~WorkerQueue();

  /// Why a task was not queued.
  enum class Refusal : std::uint8_t { none, user_full, full };
  /// Queues a task of a user. reserved: the task may use the room that is kept for clients that may arm or
  /// configure. Any thread; does not wait for a task.
  Refusal post(uid_t user, bool reserved, std::function<void()> task);

  /// Each client has at most one task. A client that connects again may leave one behind.
  static constexpr std::size_t kMaxQueued = 48;
  static constexpr std::size_t kMaxQueuedPerUser = 16;
  /// Part of kMaxQueued that only tasks with `reserved` may use.
  static constexpr std::size_t kReserved = 16;

 private:
  struct Task {
    uid_t user;
    std::function<void()> run;
  };
  void run(const std::stop_token& stop);
  std::function<void()> take_next();

  std::mutex mutex_;  ///< protects queue_, turn_ and last_turns_
  std::condition_variable_any changed_;
  std::deque<Task> queue_;  ///< in the order of arrival
  std::uint64_t turn_ = 0;
  std::map<uid_t, std::uint64_t>
      last_turns_;       ///< number of the last turn: users with queued tasks, and the last user
  std::jthread thread_;  ///< last member: it uses the members above
};

}  // namespace wrenchd
