// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <thread>

#include "daemon/servo_loop.hpp"

namespace wrenchd {

/// One line of the log for an event of the servo thread.
std::string to_text(const Event& event);

/// Drains the servo thread's events into the log, on a thread of its own.
class EventLog {
 public:
  explicit EventLog(ServoLoop& loop);
  /// Logs what is still in the ring.
  ~EventLog();

 private:
  void drain();

  ServoLoop& loop_;
  std::uint64_t dropped_said_ = 0;
  std::jthread thread_;
};

}  // namespace wrenchd
