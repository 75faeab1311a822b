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

/// Waits for a device to be plugged in. Not RT safe: no servo loop runs meanwhile.
class DeviceWait {
 public:
  /// Hears of devices that are plugged in from now on. Where the system has no monitor to give it logs why.
  DeviceWait();

  /// Calls `attempt` at once, each time something was plugged in or taken out, and once a second, for a node
  /// may get its name or its permissions a little after the device is told of; until it returns true
  /// (true) or `stop` does (false), which is asked ten times a second. What attempt throws ends the waiting.
  bool until(const std::function<bool()>& attempt, const std::function<bool()>& stop);

  /// Logs what is plugged in instead, and why it will not do: each line once, until it was not there.
  void log_rejected(const std::vector<std::string>& seen);

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool plug_event_pending_ = false;
  std::set<std::string> logged_;
  std::unique_ptr<HotplugMonitor> monitor_;  ///< last: its thread uses all of the above
};

}  // namespace wrenchd
