// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "core/clock.hpp"
#include "devices/discovery/usb_devices.hpp"
#include "devices/links/latest_writer.hpp"
#include "devices/links/link_settings.hpp"
#include "devices/links/report_link.hpp"

struct hid_device_;  // hidapi's

namespace wrenchd {

/// A USB HID device through the kernel's own driver: hidapi, hidraw backend. The default transport.
///
/// Reports stand as they do on the wire: their id first where the device numbers its reports, without one
/// where it does not (hidapi wants a 0 there on writing; that is done here).
///
/// Reading is done on the servo thread: a poll and a read, which neither wait, lock nor allocate. Writing is
/// not: a device that takes nothing keeps a write in the kernel for 5 s, so a LatestWriter does it.
class HidrawLink final : public ReportLink {
 public:
  /// `device`: as list_usb_devices() tells it.
  explicit HidrawLink(UsbDevice device, LinkSettings settings = {});
  ~HidrawLink() override { close(); }
  HidrawLink(const HidrawLink&) = delete;
  HidrawLink& operator=(const HidrawLink&) = delete;

  /// Throws where the node cannot be opened, or is another device by now: ids, serial number, interface and
  /// report descriptor are compared, and nothing is ever written to one that differs. Throws where another
  /// HidrawLink has it, in this process or another: the node is locked while this is open.
  void open() override;
  /// hidraw does not say when a report arrived, so that is taken to be now; a report is never older than one
  /// tick but in one case: the kernel's ring was full and dropped what came later. Then it is said to have
  /// arrived when the ring was last seen empty. An unplugged device is gone at once, whatever still waits.
  LinkRead read(TimePoint now, std::span<std::uint8_t> buffer) noexcept override;
  /// Hands the report to the writer. `empty` where the writer is overdue or the write before it failed; the
  /// report is in the slot then all the same.
  LinkStatus write(TimePoint now, std::span<const std::uint8_t> report) noexcept override;
  void wait_readable(TimePoint deadline) noexcept override;
  /// Writes the last report handed over, waiting for it as long as the settings say. Where a write is stuck
  /// in the kernel that holds on to closing, too: up to 5 s more.
  void close() noexcept override;

  const UsbDevice& device() const noexcept { return device_; }
  /// Of the writer, while open; nullptr before.
  const LatestWriter* writer() const noexcept { return writer_ ? &*writer_ : nullptr; }

 private:
  /// The most the kernel's HID core passes on in one report.
  static constexpr std::size_t kMaxHidReportBytes = 16384;
  /// What the kernel keeps for one reader: a ring of 64, of which one stays free.
  static constexpr int kKernelRingCapacity = 63;

  struct CloseHid {
    void operator()(hid_device_* device) const noexcept;
  };
  using Hid = std::unique_ptr<hid_device_, CloseHid>;

  static LinkStatus write_blocking(hid_device_* hid, bool numbered, std::span<const std::uint8_t> report);
  LinkRead mark_disconnected(TimePoint now) noexcept;

  UsbDevice device_;
  LinkSettings settings_;
  Hid reader_;
  int fd_ = -1;  ///< hidapi's, of reading_: to wait with the precision that hidapi does not offer
  bool disconnected_ = false;
  std::optional<TimePoint> last_seen_empty_;  ///< when nothing waited
  int taken_since_empty_ = 0;
  std::array<std::uint8_t, kMaxHidReportBytes> bytes_{};
  std::optional<LatestWriter> writer_;
};

}  // namespace wrenchd
