// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace wrenchd {

/// One interface of something that is plugged in. A HID interface has a hidraw node; what hidapi and libusb
/// call a device is this.
struct UsbDevice {
  std::string hidraw_node;  ///< "/dev/hidraw3"; empty where the interface is not HID or has no driver
  std::string usb_node;     ///< "/dev/bus/usb/003/002"; empty where it is not on USB (Bluetooth, uhid)
  std::string port_path;    ///< bus and ports, "3-1.2": the socket it is in; empty where not on USB
  int interface = -1;       ///< bInterfaceNumber; -1 where not on USB
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  std::string serial;  ///< empty where the device tells none
  std::string manufacturer;
  std::string product_name;
  std::vector<std::uint8_t> report_descriptor;  ///< raw, as the kernel keeps it; empty where not HID
  std::uint16_t usage_page = 0;                 ///< of the first collection; 0 where not HID
  std::uint16_t usage = 0;
  bool numbered_reports = false;  ///< reports begin with their id

  /// The same device as far as it can tell: ids, serial number, interface and report descriptor. Not the
  /// place and not the nodes.
  bool is_same_device(const UsbDevice& other) const;
};

/// Everything plugged in, but hubs: by place, then interface, then hidraw number, numbers as numbers. Throws
/// std::runtime_error where udev cannot be asked. Not RT safe; takes milliseconds.
std::vector<UsbDevice> list_usb_devices();

/// What a device says of itself, fit for a terminal and a log: no character that moves a cursor or begins a
/// line.
std::string to_printable(std::string text);

/// "1209:6d0f serial 42 in 3-1.2, interface 0", for messages; its serial number made plain.
std::string describe(const UsbDevice& device);

/// Why a node cannot be opened for reading and writing, and the cure; empty where it can. Asks the system,
/// opens nothing.
std::string open_error(const UsbDevice& device, const std::string& node);
/// The same for a given errno. Where it is a matter of permission the cure is the udev rule, word for word.
std::string open_error(const UsbDevice& device, const std::string& node, int error);

/// The bus and ports in a path below /sys: the last part like "3-1.2", or nothing.
std::string port_path_in(std::string_view sys_path);

}  // namespace wrenchd
