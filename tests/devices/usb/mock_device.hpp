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

// GLib's and umockdev's, whose headers stay out of the tests.
typedef struct _UMockdevTestbed UMockdevTestbed;

namespace wrenchd::test {

using Bytes = std::vector<std::uint8_t>;

/// A /sys and /dev of the test's own, for libudev, hidapi and libusb in this process (umockdev). Needs the
/// program to run under umockdev-wrapper; throws where it does not.
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

/// What a mock device says of itself.
struct MockIdentity {
  std::string place = "1-1";
  int number = 0;  ///< of hidraw node and USB address
  std::string serial = "A1";
  std::string vendor = "1209";
  std::string product = "6d0f";
  bool numbered_reports = true;
  bool hid = true;  ///< otherwise a vendor's own interface with bulk endpoints
  bool out_endpoint = true;
};

/// 64 bytes in, 32 out, on a vendor page; with report ids as in devices/README.md, or without.
Bytes report_descriptor(bool numbered);

/// A HID device in a MockMachine: what the kernel shows of it, and behind its hidraw node a pseudo terminal,
/// whose far end is the device. What goes in is a stream, so the far end reads in pieces of the length it
/// asks for.
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
  /// The next bytes the host wrote; waits for them.
  Bytes receive(std::size_t length);
  /// Bytes that wait to be received.
  bool anything_received() const;
  /// Out of its socket: the node hangs up and udev is told.
  void unplug();

 private:
  struct Ioctls;

  MockMachine& machine_;
  MockIdentity identity_;
  std::string usb_path_, hidraw_path_;
  int master_ = -1, slave_ = -1;
  std::unique_ptr<Ioctls> ioctls_;
};

/// A USB device in a MockMachine as libusb sees it: the kernel's usbfs, mocked. Endpoint 0x81 in, 0x01 out.
class MockUsb {
 public:
  MockUsb(MockMachine& machine, MockIdentity identity);
  ~MockUsb();
  MockUsb(const MockUsb&) = delete;
  MockUsb& operator=(const MockUsb&) = delete;

  /// A report to the host, as soon as it waits for one.
  void send(const Bytes& report);
  /// The endpoint halts: transfers of the host end with a stall until it clears it.
  void stall();
  /// The next report the host wrote; waits for it.
  Bytes receive();
  /// From now on no report of the host's is taken, or they are again.
  void set_deaf(bool deaf);
  void unplug();

  /// wValue and wIndex of the last SET_REPORT; what it carried is received like any report.
  std::pair<int, int> set_report() const;
  int halts_cleared() const;
  int in_flight() const;  ///< IN transfers that wait
  bool claimed() const;
  bool kernel_driver() const;  ///< the kernel's own driver has the interface

 private:
  struct Ioctls;

  MockMachine& machine_;
  MockIdentity identity_;
  std::string usb_path_, interface_path_;
  std::unique_ptr<Ioctls> ioctls_;
};

}  // namespace wrenchd::test
