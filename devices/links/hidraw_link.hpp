// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "core/clock.hpp"
#include "devices/declared_reports.hpp"
#include "devices/discovery/usb_devices.hpp"
#include "devices/links/latest_writer.hpp"
#include "devices/links/link_settings.hpp"
#include "devices/links/report_link.hpp"

struct hid_device_;  // type of hidapi

namespace wrenchd {

/// Result of a write to a hidraw node that returned `written` and set `error`, for a report of `expected`
/// bytes.
LinkStatus write_status(int written, std::size_t expected, int error) noexcept;

/// USB HID device through the kernel driver: hidapi, hidraw backend. The default transport.
///
/// Reports have the format of the wire: the id comes first if the device numbers its reports, and there is no
/// id otherwise. hidapi needs a 0 in its place on writing; the link adds it.
///
/// The servo thread reads: a poll and a read, which do not wait, lock or allocate. If a device accepts no
/// data, a write stays in the kernel for 5 s. A LatestWriter therefore writes.
class HidrawLink final : public ReportLink {
 public:
  /// `device`: an entry of list_usb_devices().
  explicit HidrawLink(UsbDevice device, LinkSettings settings = {});
  ~HidrawLink() override { close(); }
  HidrawLink(const HidrawLink&) = delete;
  HidrawLink& operator=(const HidrawLink&) = delete;

  /// Opens and locks the node. Throws std::runtime_error if the node cannot be opened, if another HidrawLink
  /// of any process has locked it, or if another device is behind the node now. For the last check it
  /// compares ids, serial number, interface and report descriptor, before any write. Not RT-safe: may take
  /// milliseconds.
  void open() override;
  /// hidraw has no arrival times, so the arrival time is `now` and at most one tick late. Exception: if the
  /// kernel ring was full, it dropped later reports; then the arrival time is the time at which the ring was
  /// last empty. After unplugging the link is disconnected at once, even if reports still wait. RT-safe.
  LinkRead read(TimePoint now, std::span<std::uint8_t> buffer) noexcept override;
  /// Submits the report to the writer. Returns `not_ready` if the writer is overdue or the previous write
  /// failed; the report is then submitted nevertheless. RT-safe.
  LinkStatus write(TimePoint now, std::span<const std::uint8_t> report) noexcept override;
  void wait_readable(TimePoint deadline) noexcept override;
  bool declares(std::span<const std::uint8_t> report) const noexcept override {
    return declared_.contains(report);
  }
  /// Writes the last submitted report and waits for it at most for the close_timeout of the settings. If a
  /// write is still stuck in the kernel then, a thread of its own closes the node when the kernel gives up
  /// the write, after at most 5 s; until then the node is locked. Not RT-safe: waits.
  void close() noexcept override;

  const UsbDevice& device() const noexcept { return device_; }

 private:
  /// Longest report that the HID core of the kernel delivers.
  static constexpr std::size_t kMaxHidReportBytes = 16384;
  /// Capacity of the kernel ring of one reader: 64 entries, of which one stays free.
  static constexpr int kKernelRingCapacity = 63;

  struct CloseHid {
    void operator()(hid_device_* device) const noexcept;
  };
  using Hid = std::unique_ptr<hid_device_, CloseHid>;

  static LinkStatus write_blocking(hid_device_* hid, bool numbered, std::span<const std::uint8_t> report);
  static void close_later(Hid hid, int fd) noexcept;
  LinkRead mark_disconnected(TimePoint now) noexcept;

  UsbDevice device_;
  LinkSettings settings_;
  Hid reader_;
  int fd_ = -1;  ///< file descriptor that hidapi opened for reader_; ppoll on it waits with a precision that
                 ///< hidapi does not offer
  bool disconnected_ = false;
  std::optional<TimePoint> last_seen_empty_;  ///< last time at which no report was waiting
  int taken_since_empty_ = 0;
  std::array<std::uint8_t, kMaxHidReportBytes> bytes_{};
  std::optional<LatestWriter> writer_;
  DeclaredReports declared_;  ///< input reports in the descriptor of the device
};

}  // namespace wrenchd
