// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <thread>

namespace wrenchd {

/// A device was connected or disconnected.
struct HotplugEvent {
  enum class Kind : std::uint8_t { connected, disconnected };
  Kind kind = Kind::connected;
  std::string subsystem;  ///< "hidraw", or "usb" for a whole device (not each interface)
  std::string node;       ///< "/dev/hidraw3", "/dev/bus/usb/003/002"
  std::string port_path;  ///< bus and ports, "3-1.2"; empty if the device is not on USB
};

/// Notifies a listener when a device is connected or disconnected, on a thread of its own. It does not report
/// devices that were connected before its construction. Construct it first and then call list_usb_devices(),
/// so that no device is missed in between. Not RT-safe.
class HotplugMonitor {
 public:
  /// The monitor's thread calls it. It must not throw.
  using Listener = std::function<void(const HotplugEvent&)>;

  /// Source of the notifications. udev notifies after its rules have set the permissions of the node; the
  /// kernel notifies before. On a system without udev, only the kernel notifies.
  enum class Source : std::uint8_t { automatic, udev, kernel };

  /// Throws std::runtime_error if the system cannot create a monitor.
  explicit HotplugMonitor(Listener listener, Source source = Source::automatic);
  /// Ends the thread. The listener is not called after the destructor.
  ~HotplugMonitor();
  HotplugMonitor(const HotplugMonitor&) = delete;
  HotplugMonitor& operator=(const HotplugMonitor&) = delete;

 private:
  struct Watch;

  std::unique_ptr<Watch> watch_;
  std::thread thread_;
};

}  // namespace wrenchd
