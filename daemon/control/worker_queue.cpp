// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/worker_queue.hpp"

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

bool WorkerQueue::post(std::function<void()> task) {
  {
    const std::scoped_lock lock(mutex_);
    if (queue_.size() >= kMaxQueued) return false;
    queue_.push_back(std::move(task));
  }
  changed_.notify_one();
  return true;
}

void WorkerQueue::run(const std::stop_token& stop) {
  ThreadGuard guard("worker of slow requests");
  while (true) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, stop, [this] { return !queue_.empty(); });
    if (stop.stop_requested()) return;
    const std::function<void()> task = std::move(queue_.front());
    queue_.pop_front();
    lock.unlock();
    guard.run(task);
  }
}

}  // namespace wrenchd
