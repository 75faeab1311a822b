// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <vector>

#include "config/load_loopback_script.hpp"
#include "core/clock.hpp"

namespace wrenchd {

class ServoLoop;

/// The requests of the command line to the servo loop: arm once, and the commands of a loopback script at
/// their times. Not RT-safe. One thread.
class ScheduledRequests {
 public:
  /// arm: arm once, as soon as the loop is disarmed. commands: sorted by time, which counts from `start`.
  ScheduledRequests(bool arm, std::vector<TimedCommand> commands, TimePoint start);

  /// Sends to the loop what is due at `now`.
  void send_due(ServoLoop& loop, TimePoint now);
  /// Does not arm any more: a device that was unplugged comes back disarmed.
  void cancel_arm() noexcept { arm_ = false; }
  /// Returns the time of the next command, or `limit` if that is earlier.
  TimePoint next_time(TimePoint limit) const;

 private:
  bool arm_;
  std::vector<TimedCommand> commands_;
  TimePoint start_;
  std::size_t next_ = 0;  ///< index of the first command that is not sent yet
};

}  // namespace wrenchd
