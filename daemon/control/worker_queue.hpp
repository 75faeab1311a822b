// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

namespace wrenchd {

/// Does what takes long, one piece after the other, beside the thread that may not wait. What pieces throw
/// ends the process: they have to answer for themselves.
class WorkerQueue {
 public:
  WorkerQueue();
  /// Waits for the piece that is under way; the others are dropped.
  ~WorkerQueue();

  /// False: too much waits already. Any thread; never waits for a piece.
  bool post(std::function<void()> piece);

  static constexpr std::size_t kMaxQueued = 8;

 private:
  void run(const std::stop_token& stop);

  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<std::function<void()>> queue_;
  std::jthread thread_;  ///< last: it uses all of the above
};

}  // namespace wrenchd
