// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <string>

#include "daemon/output_queue.hpp"

namespace spdlog::sinks {
class sink;
}

namespace wrenchd {

/// The log of the process: standard error, or the system journal if standard error is connected to it. Every
/// line goes through an OutputQueue, so that no thread that logs waits for the reader of the log. Create one
/// object, in main(). Not RT-safe: allocates.
class LogOutput {
 public:
  /// verbose: logs debug lines too. Call it before other threads log.
  explicit LogOutput(bool verbose);
  /// Calls close(). Later log lines are dropped.
  ~LogOutput();
  LogOutput(const LogOutput&) = delete;
  LogOutput& operator=(const LogOutput&) = delete;

  /// Writes a text to standard error, as it is.
  void print_error(std::string text);

  /// Waits for the lines that are queued, as OutputQueue::close(). Later lines are dropped. Returns false if
  /// the reader of the log does not read: a thread is then left in a write, and the process must end by
  /// _exit().
  bool close() noexcept { return queue_.close(); }

 private:
  LogOutput(bool verbose, const std::shared_ptr<spdlog::sinks::sink>& target);

  OutputQueue queue_;
};

}  // namespace wrenchd
