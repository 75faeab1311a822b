// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "devices/discovery/hotplug_monitor.hpp"

namespace wrenchd {

/// Waits for a device. Not RT-safe: waits without limit; no servo loop runs meanwhile.
class DeviceWait {
 public:
  /// Starts to monitor hotplug events. If the system has no monitor, logs the reason and polls.
  DeviceWait();

  /// Calls `attempt` at once, after each hotplug event, and once a second: udev may set the name and the
  /// permissions of a device node shortly after the event. Returns true when `attempt` returns true. Returns
  /// false when `stop` returns true; calls `stop` every 100 ms. An exception of `attempt` passes through.
  bool until(const std::function<bool()>& attempt, const std::function<bool()>& stop);

  /// Logs each line, which names a connected device and why it is rejected. Logs a line again only if it was
  /// absent from one call.
  void log_rejected(const std::vector<std::string>& lines);

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool plug_event_pending_ = false;          ///< protected by mutex_
  std::set<std::string> logged_;             ///< lines of the last call of log_rejected()
  std::unique_ptr<HotplugMonitor> monitor_;  ///< last member: its thread uses the members above
};

}  // namespace wrenchd
