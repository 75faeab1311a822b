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

/// What a device says of itself before anything else.
struct UsbIdentity {
  std::uint16_t vendor = 0x1209;
  std::uint16_t product = 0x6d0f;
  std::string serial = "A1";  ///< empty: it tells none
};

/// One interface of a device: its endpoints, and what it is.
struct UsbShape {
  std::vector<std::uint8_t> report_descriptor;  ///< empty: a vendor's own interface with bulk endpoints
  std::uint8_t in = 0x81;
  std::uint8_t out = 0x01;  ///< 0: none, reports go to it by control transfers
  std::uint8_t in_bytes = 64;
  std::uint8_t out_bytes = 32;
  std::string product = "reference device";
  bool high_speed = true;  ///< bInterval is 1 in any case: 125 us, or 1 ms
};

/// A device plugged into this machine: it speaks USB/IP with the kernel's own virtual host controller
/// (vhci_hcd), over a socket pair. Everything above that controller is what a real device meets. What the
/// device is, whoever derives from this says; it must call unplug() when it is destroyed.
class UsbipPort {
 public:
  UsbipPort(const UsbipPort&) = delete;
  UsbipPort& operator=(const UsbipPort&) = delete;

  /// Into that port of the virtual controller. Throws std::runtime_error where the port is taken or there is
  /// no controller.
  void plug(int port);
  void unplug();

 protected:
  using Bytes = std::vector<std::uint8_t>;
  /// A transfer of the host's that waits for an answer.
  struct Transfer {
    std::uint32_t number = 0;
    std::uint32_t length = 0;
    Bytes data;  ///< what the host sends, where it does
  };

  /// `priority`: SCHED_FIFO, of the device's own thread.
  UsbipPort(UsbIdentity identity, UsbShape shape, int priority);
  ~UsbipPort();

  // All of these on the device's own thread, under mutex_.

  /// It is plugged in. Returns when something is to be done first.
  virtual TimePoint begin(TimePoint now) = 0;
  /// That time has come, or passed. Returns when it is the next time.
  virtual TimePoint on_time(TimePoint now) = 0;
  /// The host waits for a report: another transfer is in in_.
  virtual void on_in() = 0;
  /// The host sends a report. It is to be answered by reply().
  virtual void on_out(Transfer transfer) = 0;
  /// A report by SET_REPORT.
  virtual void on_set_report(std::span<const std::uint8_t> data) = 0;
  virtual void on_clear_halt() {}
  /// A request of the vendor's; false: stalled.
  virtual bool on_vendor_request(std::uint8_t /*request*/, std::uint16_t /*value*/) { return false; }

  void reply(std::uint32_t number, std::int32_t status, std::uint32_t length,
             std::span<const std::uint8_t> in);

  mutable std::mutex mutex_;  ///< over all that the device is
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
  std::array<std::uint8_t, 8192> received_{};  ///< from the host, and not yet understood
  std::size_t received_bytes_ = 0;
  std::atomic<bool> pulled_{false};
};

}  // namespace wrenchd::test
