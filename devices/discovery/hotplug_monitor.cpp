// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/discovery/hotplug_monitor.hpp"

#include <array>
#include <atomic>
#include <filesystem>
#include <stdexcept>
#include <string_view>
#include <utility>

#include <libudev.h>
#include <poll.h>

#include "devices/discovery/udev_text.hpp"
#include "devices/discovery/usb_devices.hpp"
#include "devices/links/wake_up.hpp"

namespace wrenchd {
namespace {

/// udev is running if its control socket exists.
bool udev_runs() {
  std::error_code ignored;
  return std::filesystem::exists("/run/udev/control", ignored);
}

const char* source_name(HotplugMonitor::Source source) {
  if (source == HotplugMonitor::Source::automatic)
    source = udev_runs() ? HotplugMonitor::Source::udev : HotplugMonitor::Source::kernel;
  return source == HotplugMonitor::Source::udev ? "udev" : "kernel";
}

}  // namespace

struct HotplugMonitor::Watch {
  Watch(Listener to, const char* source) : listener(std::move(to)) {
    context = udev_new();
    monitor = context == nullptr ? nullptr : udev_monitor_new_from_netlink(context, source);
    if (monitor == nullptr ||
        udev_monitor_filter_add_match_subsystem_devtype(monitor, "hidraw", nullptr) < 0 ||
        udev_monitor_filter_add_match_subsystem_devtype(monitor, "usb", "usb_device") < 0 ||
        udev_monitor_enable_receiving(monitor) < 0) {
      release();
      throw std::runtime_error(
          "cannot monitor connected devices (udev monitor); allow AF_NETLINK sockets "
          "(RestrictAddressFamilies=)");
    }
  }
  ~Watch() { release(); }
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;

  void release() noexcept {
    if (monitor != nullptr) udev_monitor_unref(monitor);
    if (context != nullptr) udev_unref(context);
  }

  void run() noexcept {
    std::array<pollfd, 2> files{pollfd{udev_monitor_get_fd(monitor), POLLIN, 0},
                                pollfd{ending.fd(), POLLIN, 0}};
    for (;;) {
      if (poll(files.data(), files.size(), -1) < 0) continue;
      if (files[1].revents != 0) return;
      if (udev_device* const device = udev_monitor_receive_device(monitor); device != nullptr) {
        notify(device);
        udev_device_unref(device);
      }
    }
  }

  void notify(udev_device* device) noexcept {
    const std::string_view action = udev_device_get_action(device);
    if (action != "add" && action != "remove") return;
    listener({action == "add" ? HotplugEvent::Kind::connected : HotplugEvent::Kind::disconnected,
              udev_text(udev_device_get_subsystem(device)), udev_text(udev_device_get_devnode(device)),
              port_path_in(udev_text(udev_device_get_devpath(device)))});
  }

  Listener listener;
  udev* context = nullptr;
  udev_monitor* monitor = nullptr;
  WakeUp ending;
};

HotplugMonitor::HotplugMonitor(Listener listener, Source source)
    : watch_(std::make_unique<Watch>(std::move(listener), source_name(source))),
      thread_([watch = watch_.get()] { watch->run(); }) {}

HotplugMonitor::~HotplugMonitor() {
  watch_->ending.wake();
  thread_.join();
}

}  // namespace wrenchd
