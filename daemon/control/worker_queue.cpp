// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/worker_queue.hpp"

#include <algorithm>
#include <utility>

#include <pthread.h>

namespace wrenchd {

WorkerQueue::WorkerQueue() : thread_([this](const std::stop_token& stop) { run(stop); }) {
  pthread_setname_np(thread_.native_handle(), "worker");
}

WorkerQueue::~WorkerQueue() {
  thread_.request_stop();
  thread_.join();
}

WorkerQueue::Refusal WorkerQueue::post(uid_t user, bool reserved, std::function<void()> task) {
  {
    const std::scoped_lock lock(mutex_);
    const auto of_user = static_cast<std::size_t>(std::count_if(
        queue_.begin(), queue_.end(), [user](const Task& queued) { return queued.user == user; }));
    if (of_user >= kMaxQueuedPerUser) return Refusal::user_full;
    if (queue_.size() >= (reserved ? kMaxQueued : kMaxQueued - kReserved)) return Refusal::full;
    queue_.push_back({user, std::move(task)});
  }
  changed_.notify_one();
  return Refusal::none;
}

/// Precondition: mutex_ is locked, and a task is queued.
std::function<void()> WorkerQueue::take_next() {
  const auto last_turn = [this](const Task& task) {
    const auto found = last_turns_.find(task.user);
    return found == last_turns_.end() ? std::uint64_t{0} : found->second;
  };
  const auto next = std::min_element(queue_.begin(), queue_.end(), [&](const Task& a, const Task& b) {
    return last_turn(a) < last_turn(b);  // of equal ones the first that has arrived
  });
  const uid_t user = next->user;
  std::function<void()> task = std::move(next->run);
  queue_.erase(next);
  last_turns_[user] = ++turn_;
  std::erase_if(last_turns_, [&](const auto& entry) {
    return entry.first != user && std::none_of(queue_.begin(), queue_.end(), [&entry](const Task& queued) {
             return queued.user == entry.first;
           });
  });
  return task;
}

void WorkerQueue::run(const std::stop_token& stop) {
  while (true) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, stop, [this] { return !queue_.empty(); });
    if (stop.stop_requested()) return;
    const std::function<void()> task = take_next();
    lock.unlock();
    task();
  }
}

}  // namespace wrenchd
