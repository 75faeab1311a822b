// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

// Types of GLib and umockdev; the tests do not include their headers.
typedef struct _UMockdevTestbed UMockdevTestbed;

namespace wrenchd::test {

using Bytes = std::vector<std::uint8_t>;

/// A mocked /sys and /dev for libudev, hidapi and libusb in this process (umockdev). Throws if the program
/// does not run under umockdev-wrapper.
class MockMachine {
 public:
  MockMachine();
  ~MockMachine();
  MockMachine(const MockMachine&) = delete;
  MockMachine& operator=(const MockMachine&) = delete;

  UMockdevTestbed* testbed() const { return testbed_; }

 private:
  UMockdevTestbed* testbed_;
};

/// Identity of a mock device.
struct MockIdentity {
  std::string place = "1-1";
  int number = 0;  ///< number of the hidraw node, and USB address
  std::string serial = "A1";
  std::string vendor = "1209";
  std::string product = "6d0f";
  bool numbered_reports = true;
  bool hid = true;  ///< false: a vendor-defined interface with bulk endpoints
  bool out_endpoint = true;
};

/// Returns a descriptor with input reports of 64 bytes and output reports of 32 bytes on a vendor page; with
/// the report ids of devices/README.md, or without.
Bytes report_descriptor(bool numbered);

/// A HID device in a MockMachine: its entries in /sys and /dev, and a pseudo terminal as its hidraw node. The
/// terminal is a byte stream, so the device must read reports by their length.
class MockHidraw {
 public:
  MockHidraw(MockMachine& machine, MockIdentity identity);
  ~MockHidraw();
  MockHidraw(const MockHidraw&) = delete;
  MockHidraw& operator=(const MockHidraw&) = delete;

  std::string node() const;
  /// Sends a report to the host. The node is a byte stream: if the host reads two reports at once, it gets
  /// them as one report that is too long. A real hidraw node keeps them apart.
  void send(const Bytes& report);
  /// Returns true while the host has not read all that send() wrote.
  bool report_waits() const;
  /// Waits for bytes from the host and returns them.
  Bytes receive(std::size_t length);
  /// Returns true if bytes from the host wait.
  bool anything_received() const;
  /// Disconnects the device: closes the node and sends the udev event.
  void unplug();

 private:
  struct Ioctls;

  MockMachine& machine_;
  MockIdentity identity_;
  std::string usb_path_, hidraw_path_;
  int master_ = -1, slave_ = -1;
  std::unique_ptr<Ioctls> ioctls_;
};

/// A USB device in a MockMachine with a mocked usbfs, for libusb. Endpoint 0x81 in, 0x01 out.
class MockUsb {
 public:
  MockUsb(MockMachine& machine, MockIdentity identity);
  ~MockUsb();
  MockUsb(const MockUsb&) = delete;
  MockUsb& operator=(const MockUsb&) = delete;

  /// Sends a report when the host waits for one.
  void send(const Bytes& report);
  /// Halts the endpoint: transfers stall until the host clears the halt.
  void stall();
  /// Waits for a report of the host and returns it.
  Bytes receive();
  /// Selects whether the device accepts reports of the host.
  void set_blocked(bool blocked);
  void unplug();

  /// wValue and wIndex of the last SET_REPORT; receive() returns its report.
  std::pair<int, int> set_report() const;
  int halts_cleared() const;
  int in_flight() const;  ///< number of pending IN transfers
  bool claimed() const;
  bool kernel_driver() const;  ///< true if the kernel driver is bound to the interface

 private:
  struct Ioctls;

  MockMachine& machine_;
  MockIdentity identity_;
  std::string usb_path_, interface_path_;
  std::unique_ptr<Ioctls> ioctls_;
};

}  // namespace wrenchd::test
