// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "core/clock.hpp"
#include "devices/declared_reports.hpp"
#include "devices/discovery/usb_devices.hpp"
#include "devices/links/link_settings.hpp"
#include "devices/links/report_link.hpp"
#include "devices/links/write_slot.hpp"

namespace wrenchd {

/// Event counts of a UsbLink since it was opened.
struct UsbLinkCounts {
  std::uint64_t dropped = 0;  ///< reports dropped because the ring was full
  std::uint64_t stalls = 0;   ///< halted endpoints that were cleared
  std::uint64_t errors = 0;   ///< IN transfers that ended with another error
};

/// USB device through libusb, without the kernel's HID driver, for non-HID devices and for rates at which no
/// report may be lost. Several IN transfers wait at the device at any time, so that the host receives every
/// frame. If a kernel driver is attached, it is detached while the link is open.
///
/// The link reads the first interrupt IN endpoint of the interface and writes its first interrupt OUT
/// endpoint. If there is no interrupt endpoint, it uses the first bulk endpoint. The settings may name other
/// endpoints. For a serial chip, the settings define the start-up and the framing of the byte stream. If a
/// HID interface has no OUT endpoint, the link sends SET_REPORT requests. Reports have the format of the
/// wire.
///
/// A thread of the link calls libusb. A lock-free ring of reports and a slot for the newest command connect
/// it with the servo thread. No function that the servo thread calls waits, locks or allocates.
class UsbLink final : public ReportLink {
 public:
  /// `device`: an entry of list_usb_devices(). Port path and interface locate the device; open() compares the
  /// other members.
  explicit UsbLink(UsbDevice device, LinkSettings settings = {});
  ~UsbLink() override;
  UsbLink(const UsbLink&) = delete;
  UsbLink& operator=(const UsbLink&) = delete;

  /// Throws std::runtime_error if no device is connected at the port, it is another device now (the link
  /// compares ids, serial number and report descriptor, and writes nothing to another device), it cannot be
  /// opened, or it has no IN endpoint. Not RT-safe: may take seconds.
  void open() override;
  LinkRead read(TimePoint now, std::span<std::uint8_t> buffer) noexcept override;
  /// Submits the report. Returns `not_ready` if the device has no OUT endpoint and is not HID, or as
  /// WriteSlot::submit(). RT-safe.
  LinkStatus write(TimePoint now, std::span<const std::uint8_t> report) noexcept override;
  void wait_readable(TimePoint deadline) noexcept override;
  bool declares(std::span<const std::uint8_t> report) const noexcept override {
    return declared_.contains(report);
  }
  /// Writes the last submitted report within the close_timeout of the settings, then returns the interface to
  /// the kernel driver. Not RT-safe: waits.
  void close() noexcept override;

  const UsbDevice& device() const noexcept { return device_; }
  UsbLinkCounts counts() const noexcept;
  /// False if the kernel rejected the requested real-time priority; then raise the rtprio limit.
  bool priority_granted() const noexcept;
  /// Slot of the writer while the link is open; nullptr otherwise.
  const WriteSlot* slot() const noexcept;

 private:
  struct TransferThread;  ///< thread and state of the libusb transfers

  UsbDevice device_;
  LinkSettings settings_;
  DeclaredReports declared_;  ///< input reports in the descriptor of the device
  std::unique_ptr<TransferThread> transfers_;
};

}  // namespace wrenchd
