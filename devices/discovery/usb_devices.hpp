// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace wrenchd {

/// One interface of a connected device. A HID interface has a hidraw node. hidapi and libusb call it a
/// device.
struct UsbDevice {
  std::string hidraw_node;  ///< "/dev/hidraw3"; empty if the interface is not HID or has no driver
  std::string usb_node;     ///< "/dev/bus/usb/003/002"; empty if the device is not on USB (Bluetooth, uhid)
  std::string port_path;    ///< bus and ports, "3-1.2"; empty if the device is not on USB
  int interface = -1;       ///< bInterfaceNumber; -1 if the device is not on USB
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  std::string serial;  ///< empty if the device has no serial number
  std::string manufacturer;
  std::string product_name;
  /// Raw bytes from the kernel; empty if the interface is not HID.
  std::vector<std::uint8_t> report_descriptor;
  std::uint16_t usage_page = 0;  ///< of the first collection; 0 if the interface is not HID
  std::uint16_t usage = 0;
  bool numbered_reports = false;  ///< true if reports begin with their id

  /// Returns true if both have the same ids, serial number, interface and report descriptor. Ignores port and
  /// nodes.
  bool is_same_device(const UsbDevice& other) const;
};

/// Returns all connected devices except hubs, sorted by port path, interface and hidraw number, numerically.
/// Throws std::runtime_error if udev is not available. Not RT-safe: may take milliseconds.
std::vector<UsbDevice> list_usb_devices();

/// Returns text from a device with its control characters replaced by '?'. A line feed in a serial number
/// would begin a new line in logs and in what a user copies from them. Not RT-safe: allocates.
std::string without_control_characters(std::string text);

/// Returns text from a device with all control characters replaced, safe for terminals and logs. Not RT-safe:
/// allocates.
std::string to_printable(std::string text);

/// Returns "1209:6d0f serial 42 in 3-1.2, interface 0", for messages, without control characters. Not
/// RT-safe: allocates.
std::string describe(const UsbDevice& device);

/// Returns why a node cannot be opened for reading and writing, and the remedy; empty if it can. Checks the
/// permissions and does not open the node. Not RT-safe: system calls.
std::string open_error(const UsbDevice& device, const std::string& node);
/// Returns the error text for a given errno. For a permission error the remedy is the required udev rule. Not
/// RT-safe: allocates.
std::string open_error(const UsbDevice& device, const std::string& node, int error);

/// Returns bus and ports of a path below /sys: its last component of the form "3-1.2"; empty if there is
/// none. Not RT-safe: allocates.
std::string port_path_in(std::string_view sys_path);

}  // namespace wrenchd
