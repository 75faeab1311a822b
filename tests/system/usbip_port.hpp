// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "core/clock.hpp"

namespace wrenchd::test {

/// Identity of a device.
struct UsbIdentity {
  std::uint16_t vendor = 0x1209;
  std::uint16_t product = 0x6d0f;
  std::string serial = "A1";  ///< empty: no serial number
};

/// One interface of a device: its descriptor and its endpoints.
struct UsbShape {
  std::vector<std::uint8_t> report_descriptor;  ///< empty: a vendor-defined interface with bulk endpoints
  std::uint8_t in = 0x81;
  std::uint8_t out = 0x01;  ///< 0: none; control transfers carry the reports
  std::uint8_t in_bytes = 64;
  std::uint8_t out_bytes = 32;
  std::string product = "reference device";
  bool high_speed = true;  ///< true: bInterval 1 is 125 us; false: 1 ms
};

/// A device that is connected to this machine by USB/IP: a socket pair leads to the kernel's virtual host
/// controller (vhci_hcd). Above that controller everything is as for a real device. A derived class defines
/// the device and must call unplug() in its destructor.
class UsbipPort {
 public:
  UsbipPort(const UsbipPort&) = delete;
  UsbipPort& operator=(const UsbipPort&) = delete;

  /// Connects the device to this port of the virtual controller. Throws std::runtime_error if the port is in
  /// use or there is no controller.
  void plug(int port);
  void unplug();

 protected:
  using Bytes = std::vector<std::uint8_t>;
  /// A pending transfer of the host.
  struct Transfer {
    std::uint32_t number = 0;
    std::uint32_t length = 0;
    Bytes data;  ///< data of an OUT transfer
  };

  /// `priority`: SCHED_FIFO, of the device's own thread.
  UsbipPort(UsbIdentity identity, UsbShape shape, int priority);
  ~UsbipPort();

  // The device's thread calls these functions with mutex_ locked.

  /// Called after the connection. Returns the time of the first call of the next function.
  virtual TimePoint begin(TimePoint now) = 0;
  /// Called at that time or later. Returns the time of the next call.
  virtual TimePoint on_time(TimePoint now) = 0;
  /// Called for each new IN transfer of the host, which is in in_.
  virtual void on_in() = 0;
  /// Called for a report of the host; reply() must answer it.
  virtual void on_out(Transfer transfer) = 0;
  /// Called for a report by SET_REPORT.
  virtual void on_set_report(std::span<const std::uint8_t> data) = 0;
  virtual void on_clear_halt() {}
  /// Called for a vendor request; false: stall.
  virtual bool on_vendor_request(std::uint8_t /*request*/, std::uint16_t /*value*/) { return false; }

  void reply(std::uint32_t number, std::int32_t status, std::uint32_t length,
             std::span<const std::uint8_t> in);

  mutable std::mutex mutex_;  ///< protects the state of the device
  std::deque<Transfer> in_, held_out_;

 private:
  void run();
  void serve_host(bool& connected);
  std::size_t serve(std::span<const std::uint8_t> bytes);
  void submitted(std::uint32_t number, std::uint32_t direction, std::uint32_t endpoint, std::uint32_t length,
                 std::span<const std::uint8_t> setup, std::span<const std::uint8_t> data);
  void unlinked(std::uint32_t number, std::uint32_t unlink);
  void control(std::uint32_t number, std::span<const std::uint8_t> setup, std::span<const std::uint8_t> data);
  std::optional<Bytes> answer_control(std::span<const std::uint8_t> setup,
                                      std::span<const std::uint8_t> data);
  std::optional<Bytes> descriptor(unsigned type, unsigned index) const;
  Bytes configuration() const;
  void send(std::span<const std::uint8_t> bytes) const;

  UsbIdentity identity_;
  UsbShape shape_;
  int priority_;
  int port_ = -1;
  int socket_ = -1;
  std::thread thread_;
  std::array<std::uint8_t, 8192> received_{};  ///< bytes from the host that are not processed yet
  std::size_t received_bytes_ = 0;
  std::atomic<bool> pulled_{false};
};

}  // namespace wrenchd::test
