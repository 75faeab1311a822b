// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/device_wait.hpp"

#include <spdlog/spdlog.h>

#include "core/clock.hpp"
#include "devices/discovery/usb_devices.hpp"

namespace wrenchd {
namespace {

/// How often it is looked whether to stop, and how many such looks pass without an attempt.
constexpr auto kLook = std::chrono::milliseconds(100);
constexpr int kLooksBetween = 10;

}  // namespace

DeviceWait::DeviceWait() {
  try {
    monitor_ = std::make_unique<HotplugMonitor>([this](const HotplugEvent&) {
      const std::lock_guard lock(mutex_);
      plug_event_pending_ = true;
      changed_.notify_all();
    });
  } catch (const std::runtime_error& error) {
    spdlog::warn("{}; looking once a second what is plugged in", error.what());
  }
}

bool DeviceWait::until(const std::function<bool()>& attempt, const std::function<bool()>& stop) {
  while (!stop()) {
    if (attempt()) return true;
    std::unique_lock lock(mutex_);
    for (int looks = 0; looks < kLooksBetween && !plug_event_pending_ && !stop(); ++looks)
      changed_.wait_for(lock, kLook);
    plug_event_pending_ = false;
  }
  return false;
}

void DeviceWait::log_rejected(const std::vector<std::string>& seen) {
  std::set<std::string> now;
  for (const std::string& line : seen) {
    if (logged_.count(line) == 0) spdlog::info("{}", to_printable(line));
    now.insert(line);
  }
  logged_ = std::move(now);
}

}  // namespace wrenchd
