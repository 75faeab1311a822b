// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/discovery/match_profile.hpp"

#include <algorithm>
#include <array>
#include <cstdio>

#include "devices/discovery/shared_usb_ids.hpp"
#include "devices/discovery/unusable_devices.hpp"

namespace wrenchd {
namespace {

std::string hex(unsigned number) {
  std::array<char, 8> text{};
  std::snprintf(text.data(), text.size(), "%04x", number & 0xffffu);
  return text.data();
}

template <class Id>
bool contains(const std::vector<Id>& ids, Id id) {
  return std::find(ids.begin(), ids.end(), id) != ids.end();
}

/// Returns why the report is not in the device's descriptor; empty if it is.
std::string rejection(const PoseReportLayout& report, const std::vector<InputReportSize>& device_reports) {
  const std::string name = report.has_id ? "input report " + std::to_string(report.id) : "the input report";
  const std::size_t min_length = report.min_length == 0 ? report.length : report.min_length;
  for (const InputReportSize& device_report : device_reports) {
    if (device_report.id != (report.has_id ? report.id : 0)) continue;
    if (device_report.length >= min_length && device_report.length <= report.length) return {};
    return name + " of the device has " + std::to_string(device_report.length) + " bytes, in the profile " +
           std::to_string(report.length);
  }
  return name + " of the profile is not in the device's report descriptor";
}

std::string rejection_by_reports(const DeviceProfile& profile,
                                 const std::vector<InputReportSize>& device_reports) {
  std::string why = rejection(profile.pose_report, device_reports);
  for (const PoseReportLayout& report : profile.more_reports)
    if (why.empty() && carries_pose(report)) why = rejection(report, device_reports);
  return why;
}

std::string rejection_by_usage(const char* name, std::optional<std::uint16_t> wanted,
                               std::optional<std::uint16_t> found) {
  if (!wanted || wanted == found) return {};
  return std::string(name) + " is " + (found ? hex(*found) : "not known") + ", the profile requires " +
         hex(*wanted);
}

/// Returns why the device is not identified well enough to write to it; empty if it is.
std::string rejection_by_trust(const DeviceIdentity& device, const DeviceProfile& profile) {
  const DeviceMatch& match = profile.match;
  if (!profile.has_output || !match.serial.empty() || !match.product.empty()) return {};
  const bool lock_step = profile.stream == StreamStyle::lock_step;
  if (!lock_step && profile.pose_report.checksum != Checksum::none) return {};
  const std::string cure = ": set profile = \"" + profile.name +
                           "\" in [device] of wrenchd.toml, or write a profile that inherits it and states "
                           "serial or product in [match]";
  if (const SharedUsbIds* shared = find_shared_usb_id(device.id))
    return text(device.id) + " is the id of " + std::string(shared->users) +
           ", so wrenchd writes nothing to it unless it is named" + cure;
  if (lock_step) return "it sends nothing before wrenchd writes to it, so it must be named" + cure;
  return {};
}

std::string rejection(const DeviceIdentity& device, const DeviceProfile& profile, std::string_view named,
                      bool serial_named) {
  const DeviceMatch& match = profile.match;
  if (!named.empty() && profile.name != named)
    return "the configuration selects the profile " + std::string(named);
  if (named.empty() && match.only_when_named) return "it is used only if the configuration names it";
  if (profile.transport == Transport::loopback) return "it is for the simulated device";
  const bool by_layout =
      contains(match.usb_by_layout, device.id) || contains(match.usb_vendors_by_layout, device.id.vendor);
  if (!contains(match.usb, device.id) && !by_layout) return "its ids do not include " + text(device.id);
  if (!match.serial.empty() && match.serial != device.serial)
    return "it is for serial number " + match.serial + ", not " +
           (device.serial.empty() ? "a device without one" : device.serial);
  if (!match.product.empty() && match.product != device.product)
    return "it is for the product \"" + match.product + "\", not " +
           (device.product.empty() ? "a device without a product string" : "\"" + device.product + "\"");
  if (profile.transport == Transport::libusb && device.interface &&
      *device.interface != profile.endpoints.interface)
    return "it uses interface " + std::to_string(profile.endpoints.interface) + " of the device, this is " +
           std::to_string(*device.interface);
  std::string why = rejection_by_usage("the usage page", match.usage_page, device.usage_page);
  if (why.empty()) why = rejection_by_usage("the usage", match.usage, device.usage);
  if (!why.empty()) return why;
  if (!device.input_reports.empty())
    why = rejection_by_reports(profile, device.input_reports);
  else if (by_layout && !contains(match.usb, device.id))
    why = "devices with this id differ, and the report descriptor has not been read";
  if (!why.empty() || !named.empty() || serial_named) return why;
  return rejection_by_trust(device, profile);
}

/// Priority of a matching profile: a serial number before a product string before an id before a vendor.
int rank(const DeviceIdentity& device, const DeviceProfile& profile) {
  const DeviceMatch& match = profile.match;
  return (match.serial.empty() ? 0 : 8) + (match.product.empty() ? 0 : 4) +
         (contains(match.usb, device.id)             ? 2
          : contains(match.usb_by_layout, device.id) ? 1
                                                     : 0);
}

}  // namespace

bool carries_pose(const PoseReportLayout& r) noexcept {
  return r.position.present || r.orientation.present || r.joints.present || r.translation.present ||
         r.rotation.present;
}

std::string text(UsbId id) {
  return hex(id.vendor) + ":" + hex(id.product);
}

bool lists_id(const DeviceProfile& profile, UsbId id) noexcept {
  const auto holds = [](const auto& list, const auto& x) {
    return std::find(list.begin(), list.end(), x) != list.end();
  };
  const DeviceMatch& match = profile.match;
  return holds(match.usb, id) || holds(match.usb_by_layout, id) ||
         holds(match.usb_vendors_by_layout, id.vendor);
}

MatchResult match_profile(const DeviceIdentity& device, std::span<const DeviceProfile> profiles,
                          std::string_view named, bool serial_named) {
  MatchResult result;
  if (const UnusableDevice* unusable = find_unusable_device(device.id)) {
    result.rejection =
        std::string(unusable->name) + " (" + text(device.id) + "): " + std::string(unusable->reason);
    result.rejections.assign(profiles.size(), "the device cannot be used");
    return result;
  }
  int best = -1;
  for (std::size_t i = 0; i < profiles.size(); ++i) {
    result.rejections.push_back(rejection(device, profiles[i], named, serial_named));
    if (!result.rejections.back().empty()) continue;
    const int priority = rank(device, profiles[i]);
    if (priority > best) {
      result.profile = i;
      result.rejection.clear();
    } else if (priority == best) {
      result.profile.reset();
      result.rejection = "several profiles match " + text(device.id) + ", the last of them " +
                         profiles[i].name +
                         "; name one in the configuration, or add the serial number to one";
    }
    best = std::max(best, priority);
  }
  return result;
}

}  // namespace wrenchd
