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
class SlowWork {
 public:
  SlowWork();
  /// Waits for the piece that is under way; the others are dropped.
  ~SlowWork();

  /// False: too much waits already. Any thread; never waits for a piece.
  bool post(std::function<void()> piece);

  static constexpr std::size_t kMostWaiting = 8;

 private:
  void run(const std::stop_token& stop);

  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<std::function<void()>> waiting_;
  std::jthread thread_;  ///< last: it uses all of the above
};

}  // namespace wrenchd
