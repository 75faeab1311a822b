// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/worker_queue.hpp"

#include <pthread.h>

namespace wrenchd {

SlowWork::SlowWork() : thread_([this](const std::stop_token& stop) { run(stop); }) {
  pthread_setname_np(thread_.native_handle(), "slow work");
}

SlowWork::~SlowWork() {
  thread_.request_stop();
  thread_.join();
}

bool SlowWork::post(std::function<void()> piece) {
  {
    const std::scoped_lock lock(mutex_);
    if (waiting_.size() >= kMostWaiting) return false;
    waiting_.push_back(std::move(piece));
  }
  changed_.notify_one();
  return true;
}

void SlowWork::run(const std::stop_token& stop) {
  while (true) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, stop, [this] { return !waiting_.empty(); });
    if (stop.stop_requested()) return;
    const std::function<void()> piece = std::move(waiting_.front());
    waiting_.pop_front();
    lock.unlock();
    piece();
  }
}

}  // namespace wrenchd
