// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

#include <sys/types.h>

#include "daemon/control/role.hpp"

namespace wrenchd {

/// Runs tasks on a thread of its own, so that the control thread does not block. Tasks of one user run in
/// order; the users take turns. An exception of a task is logged. Not RT-safe: allocates.
///
/// A user has at most kMaxQueuedPerUser tasks in the queue, and the last places are for higher roles. So no
/// user can keep another one, or somebody with more rights, out of the queue.
class WorkerQueue {
 public:
  WorkerQueue();
  /// Waits for the running task, and drops the queued tasks.
  ~WorkerQueue();

  enum class Posted : std::uint8_t {
    yes,
    user_has_too_many,  ///< the user has kMaxQueuedPerUser tasks in the queue
    full,               ///< no place is left for this role
  };
  /// Queues a task of a user. Any thread; does not wait for a task.
  Posted post(uid_t user, Role role, std::function<void()> task);

  static constexpr std::size_t kMaxQueued = 16;
  static constexpr std::size_t kMaxQueuedPerUser = 4;
  /// Places that only operators may use; of these, half are for administrators.
  static constexpr std::size_t kReserved = 6;
  /// Returns how many tasks may be queued before one of this role is refused. RT-safe.
  static constexpr std::size_t capacity(Role role) noexcept {
    if (role == Role::observer) return kMaxQueued - kReserved;
    return role == Role::operator_ ? kMaxQueued - kReserved / 2 : kMaxQueued;
  }

 private:
  struct Task {
    uid_t user;
    std::function<void()> run;
  };

  void run(const std::stop_token& stop);
  Task take_next();

  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<Task> queue_;
  uid_t last_user_ = static_cast<uid_t>(-1);  ///< user of the last task
  std::jthread thread_;                       ///< last member: it uses the members above
};

}  // namespace wrenchd
