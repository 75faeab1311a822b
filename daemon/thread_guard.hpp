// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>
#include <string>
#include <utility>

namespace wrenchd {

/// Keeps a thread alive that does its work in steps: an exception of one step is logged and ends that step
/// only. Without it, std::terminate() would end the process, whatever the thread does for it. One object for
/// each thread. Not RT-safe: logs.
class ThreadGuard {
 public:
  /// thread: name of the thread in the log, for example "recording writer".
  explicit ThreadGuard(std::string thread) : thread_(std::move(thread)) {}

  /// Runs a step. Returns false if it threw.
  template <class Step>
  bool run(const Step& step) noexcept {
    try {
      step();
      return true;
    } catch (...) {
      log_exception();
    }
    return false;
  }

 private:
  void log_exception() noexcept;

  std::string thread_;
  std::string last_error_;  ///< text of the error that was logged last
  std::chrono::steady_clock::time_point logged_at_{};
};

}  // namespace wrenchd
