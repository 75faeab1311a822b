// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/worker_queue.hpp"

#include <algorithm>
#include <utility>

#include <pthread.h>

#include "daemon/thread_guard.hpp"

namespace wrenchd {

WorkerQueue::WorkerQueue() : thread_([this](const std::stop_token& stop) { run(stop); }) {
  pthread_setname_np(thread_.native_handle(), "worker");
}

WorkerQueue::~WorkerQueue() {
  thread_.request_stop();
  thread_.join();
}

WorkerQueue::Posted WorkerQueue::post(uid_t user, Role role, std::function<void()> task) {
  {
    const std::scoped_lock lock(mutex_);
    const auto own =
        std::count_if(queue_.begin(), queue_.end(), [user](const Task& one) { return one.user == user; });
    if (static_cast<std::size_t>(own) >= kMaxQueuedPerUser) return Posted::user_has_too_many;
    if (queue_.size() >= capacity(role)) return Posted::full;
    queue_.push_back({user, std::move(task)});
  }
  changed_.notify_one();
  return Posted::yes;
}

/// Takes the oldest task of another user than the last one, if there is one. Precondition: mutex_ is locked,
/// and a task is queued.
WorkerQueue::Task WorkerQueue::take_next() {
  auto next =
      std::find_if(queue_.begin(), queue_.end(), [this](const Task& one) { return one.user != last_user_; });
  if (next == queue_.end()) next = queue_.begin();
  Task task = std::move(*next);
  queue_.erase(next);
  last_user_ = task.user;
  return task;
}

void WorkerQueue::run(const std::stop_token& stop) {
  ThreadGuard guard("worker of slow requests");
  while (true) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, stop, [this] { return !queue_.empty(); });
    if (stop.stop_requested()) return;
    const Task task = take_next();
    lock.unlock();
    guard.run(task.run);
  }
}

}  // namespace wrenchd
