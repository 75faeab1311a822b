// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/device_wait.hpp"

#include <spdlog/spdlog.h>

#include "core/clock.hpp"
#include "devices/discovery/usb_devices.hpp"

namespace wrenchd {
namespace {

/// Time between two calls of `stop`.
constexpr auto kStopPeriod = std::chrono::milliseconds(100);
/// Without a hotplug event, one attempt follows this many calls of `stop`.
constexpr int kStopChecksPerAttempt = 10;

}  // namespace

DeviceWait::DeviceWait() {
  try {
    monitor_ = std::make_unique<HotplugMonitor>([this](const HotplugEvent&) {
      const std::lock_guard lock(mutex_);
      plug_event_pending_ = true;
      changed_.notify_all();
    });
  } catch (const std::runtime_error& error) {
    spdlog::warn("{}; polling the connected devices once a second", error.what());
  }
}

bool DeviceWait::until(const std::function<bool()>& attempt, const std::function<bool()>& stop) {
  while (!stop()) {
    if (attempt()) return true;
    std::unique_lock lock(mutex_);
    for (int checks = 0; checks < kStopChecksPerAttempt && !plug_event_pending_ && !stop(); ++checks)
      changed_.wait_for(lock, kStopPeriod);
    plug_event_pending_ = false;
  }
  return false;
}

void DeviceWait::log_rejected(const std::vector<std::string>& lines) {
  for (const std::string& line : lines)
    if (logged_.count(line) == 0) spdlog::info("{}", to_printable(line));
  logged_ = {lines.begin(), lines.end()};
}

}  // namespace wrenchd
