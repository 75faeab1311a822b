// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "devices/discovery/choose_device.hpp"
#include "devices/links/link_settings.hpp"
#include "devices/links/report_link.hpp"

namespace wrenchd {

/// The device that is wanted is not plugged in.
class DeviceNotFound : public std::runtime_error {
 public:
  DeviceNotFound(const std::string& what, std::vector<std::string> seen)
      : std::runtime_error(what), rejected_devices_(std::move(seen)) {}

  /// What is plugged in instead, a line each: the device, and why it is not the one.
  const std::vector<std::string>& rejected_devices() const noexcept { return rejected_devices_; }

 private:
  std::vector<std::string> rejected_devices_;
};

/// The link to the plugged-in device of a profile, by the transport that the profile names. Each open() looks
/// for the device anew, wherever it is plugged in by then. From the first one on it is that device, by ids,
/// serial number, interface and report descriptor, and no other is ever written to.
class ReconnectingLink final : public ReportLink {
 public:
  /// serial: empty for any. The profile has to be one for a device: not transport loopback. settings: those
  /// of link_settings(), and what the caller wants else.
  ReconnectingLink(DeviceProfile profile, std::string serial, LinkSettings settings);

  /// Throws DeviceNotFound where it is not plugged in, and as HidrawLink and UsbLink do where it cannot be
  /// opened.
  void open() override;
  LinkRead read(TimePoint now, std::span<std::uint8_t> buffer) noexcept override;
  LinkStatus write(TimePoint now, std::span<const std::uint8_t> report) noexcept override;
  void wait_readable(TimePoint deadline) noexcept override;
  void close() noexcept override;

  /// The device of the last open(), while nothing else is known.
  const std::optional<UsbDevice>& device() const noexcept { return criteria_.previous; }

 private:
  DeviceProfile profile_;
  DeviceCriteria criteria_;
  LinkSettings settings_;
  std::unique_ptr<ReportLink> link_;  ///< none while closed
};

/// What is plugged in, a line each: the device, and why it was not picked. The one that was has none.
std::vector<std::string> describe_rejected(std::span<const UsbDevice> plugged, const DeviceChoice& choice);

}  // namespace wrenchd
