// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/device_profile.hpp"
#include "daemon/live_line.hpp"

namespace wrenchd {

class ServoLoop;

/// Prints the state of the servo loop to standard output: on a terminal one line that it overwrites,
/// elsewhere a line for every fifth sample. Not RT-safe: prints. One thread.
class LiveView {
 public:
  /// shown: false prints nothing.
  LiveView(bool shown, const DeviceProfile& profile);

  /// Adds the newest tick record to the totals and prints it. Does nothing before the first tick.
  void sample(ServoLoop& loop);
  /// Prints the summary of the run.
  void close(const ServoLoop& loop, double seconds);

 private:
  bool shown_;
  bool terminal_;
  RunTotals totals_;
};

}  // namespace wrenchd
