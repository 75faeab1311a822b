// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <thread>

namespace wrenchd {

/// Something was plugged in or taken out.
struct HotplugEvent {
  enum class Kind : std::uint8_t { connected, disconnected };
  Kind kind = Kind::connected;
  std::string subsystem;  ///< "hidraw", or "usb": the device as a whole, not each of its interfaces
  std::string node;       ///< "/dev/hidraw3", "/dev/bus/usb/003/002"
  std::string port_path;  ///< bus and ports, "3-1.2"; empty where not on USB
};

/// Tells what is plugged in and taken out, on an ordinary thread of its own. What was plugged in before it
/// was made is not told: make it first, then list_usb_devices(), and nothing is missed between the two.
class HotplugMonitor {
 public:
  /// Called on the monitor's thread; must not throw.
  using Listener = std::function<void(const HotplugEvent&)>;

  /// Whose word is heard. udev tells of a device when its rules have run and its node has its permissions;
  /// the kernel tells of it before that. Where no udev runs only the kernel does.
  enum class Source : std::uint8_t { automatic, udev, kernel };

  /// Throws std::runtime_error where the system has no monitor to give.
  explicit HotplugMonitor(Listener listener, Source source = Source::automatic);
  /// Ends the thread; the listener is not called after that.
  ~HotplugMonitor();
  HotplugMonitor(const HotplugMonitor&) = delete;
  HotplugMonitor& operator=(const HotplugMonitor&) = delete;

 private:
  struct Watch;

  std::unique_ptr<Watch> watch_;
  std::thread thread_;
};

}  // namespace wrenchd
