// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "core/clock.hpp"
#include "devices/discovery/usb_devices.hpp"
#include "devices/links/link_settings.hpp"
#include "devices/links/report_link.hpp"
#include "devices/links/write_slot.hpp"

namespace wrenchd {

/// What happened on a UsbLink since it was opened.
struct UsbLinkCounts {
  std::uint64_t dropped = 0;  ///< reports that came while the ring was full
  std::uint64_t stalls = 0;   ///< halted endpoints that were cleared
  std::uint64_t errors = 0;   ///< IN transfers that ended with another error
};

/// A USB device without the kernel's HID driver: libusb, for devices that are not HID and for rates at which
/// every report counts. Several IN transfers wait at the device at any time, so that none of its frames finds
/// the host unprepared. The kernel's driver, if there is one, is detached while the link is open.
///
/// The first interrupt IN endpoint of the interface is read and the first interrupt OUT endpoint written;
/// where there is none of that kind, the first bulk one; or those that the settings name. A serial chip is
/// started as they say, and reports are cut out of what it sends. To a HID interface without an OUT endpoint
/// reports go as SET_REPORT requests. Reports stand as they do on the wire.
///
/// A thread of the link's own speaks with libusb. Between it and the servo thread there are a lock-free ring
/// of reports and a slot for the newest command: nothing the servo thread calls waits, locks or allocates.
class UsbLink final : public ReportLink {
 public:
  /// `device`: as list_usb_devices() tells it; place and interface say where, the rest what must be there.
  explicit UsbLink(UsbDevice device, LinkSettings settings = {});
  ~UsbLink() override;
  UsbLink(const UsbLink&) = delete;
  UsbLink& operator=(const UsbLink&) = delete;

  /// Throws where nothing is plugged in there, it is another device by now (nothing is written to that), it
  /// cannot be opened, or has no endpoint to read from.
  void open() override;
  LinkRead read(TimePoint now, std::span<std::uint8_t> buffer) noexcept override;
  /// `empty` where the device has no OUT endpoint and is not HID, or as WriteSlot::hand_over().
  LinkStatus write(TimePoint now, std::span<const std::uint8_t> report) noexcept override;
  void wait_readable(TimePoint deadline) noexcept override;
  /// Writes the last report handed over, in the time the settings give, then gives the interface back to the
  /// kernel.
  void close() noexcept override;

  const UsbDevice& device() const noexcept { return device_; }
  UsbLinkCounts counts() const noexcept;
  /// False where a real-time priority was asked for and the kernel refused: raise the rtprio limit.
  bool priority_granted() const noexcept;
  /// Of the writer, while open; nullptr before.
  const WriteSlot* slot() const noexcept;

 private:
  struct TransferThread;  ///< libusb's side

  UsbDevice device_;
  LinkSettings settings_;
  std::unique_ptr<TransferThread> transfers_;
};

}  // namespace wrenchd
