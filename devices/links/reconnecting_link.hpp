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

/// Error: the requested device is not connected.
class DeviceNotFound : public std::runtime_error {
 public:
  DeviceNotFound(const std::string& what, std::vector<std::string> rejected)
      : std::runtime_error(what), rejected_devices_(std::move(rejected)) {}

  /// Returns the connected devices and why each was rejected, one line each.
  const std::vector<std::string>& rejected_devices() const noexcept { return rejected_devices_; }

 private:
  std::vector<std::string> rejected_devices_;
};

/// Link to the connected device of a profile, over the transport that the profile names. Each open() searches
/// for the device again, in any USB port unless one is required. After the first open(), only the same device
/// is accepted: same ids, serial number, interface and report descriptor. The link never writes to another
/// device.
class ReconnectingLink final : public ReportLink {
 public:
  /// serial: serial number; empty: any. usb_port: bus and ports; empty: any. The profile must be for a real
  /// device: not transport loopback. settings: result of link_settings(), possibly with changes of the
  /// caller.
  ReconnectingLink(DeviceProfile profile, std::string serial, LinkSettings settings,
                   std::string usb_port = {});

  /// Throws DeviceNotFound if the device is not connected, and std::runtime_error like HidrawLink and UsbLink
  /// if it cannot be opened. Not RT-safe: may take seconds.
  void open() override;
  LinkRead read(TimePoint now, std::span<std::uint8_t> buffer) noexcept override;
  LinkStatus write(TimePoint now, std::span<const std::uint8_t> report) noexcept override;
  void wait_readable(TimePoint deadline) noexcept override;
  void close() noexcept override;
  bool declares(std::span<const std::uint8_t> report) const noexcept override {
    return link_ && link_->declares(report);
  }

  /// Returns the device of the last open(); empty before.
  const std::optional<UsbDevice>& device() const noexcept { return criteria_.previous; }

 private:
  DeviceProfile profile_;
  DeviceCriteria criteria_;
  LinkSettings settings_;
  std::unique_ptr<ReportLink> link_;  ///< null while closed
};

/// Returns the rejected devices with their reasons, one line each. Not RT-safe: allocates.
std::vector<std::string> describe_rejected(std::span<const UsbDevice> connected, const DeviceChoice& choice);

}  // namespace wrenchd
