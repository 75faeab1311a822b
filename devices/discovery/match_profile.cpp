// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/discovery/match_profile.hpp"

#include <algorithm>
#include <array>
#include <cstdio>

#include "devices/discovery/unusable_devices.hpp"

namespace wrenchd {
namespace {

std::string hex(unsigned number) {
  std::array<char, 8> text{};
  std::snprintf(text.data(), text.size(), "%04x", number & 0xffffu);
  return text.data();
}

bool holds(const std::vector<UsbId>& ids, UsbId id) {
  return std::find(ids.begin(), ids.end(), id) != ids.end();
}

/// Empty where the device's descriptor shows this report.
std::string why_not(const PoseReportLayout& report, const std::vector<InputReportSize>& facts) {
  const std::string name = report.has_id ? "in-report " + std::to_string(report.id) : "the in-report";
  const std::size_t least = report.min_length == 0 ? report.length : report.min_length;
  for (const InputReportSize& fact : facts) {
    if (fact.id != (report.has_id ? report.id : 0)) continue;
    if (fact.length >= least && fact.length <= report.length) return {};
    return name + " of the device has " + std::to_string(fact.length) + " bytes, that of the profile " +
           std::to_string(report.length);
  }
  return name + " of the profile is not in the device's report descriptor";
}

std::string why_not_by_reports(const DeviceProfile& profile, const std::vector<InputReportSize>& facts) {
  std::string why = why_not(profile.pose_report, facts);
  for (const PoseReportLayout& report : profile.more_reports)
    if (why.empty() && carries_pose(report)) why = why_not(report, facts);
  return why;
}

std::string why_not_by_usage(const char* name, std::optional<std::uint16_t> wanted,
                             std::optional<std::uint16_t> found) {
  if (!wanted || wanted == found) return {};
  return std::string(name) + " is " + (found ? hex(*found) : "not known") + ", the profile is for " +
         hex(*wanted);
}

std::string why_not(const DeviceIdentity& device, const DeviceProfile& profile, std::string_view named) {
  const DeviceMatch& match = profile.match;
  if (!named.empty() && profile.name != named)
    return "the configuration names the profile " + std::string(named);
  if (named.empty() && match.only_when_named) return "it is used only where the configuration names it";
  if (profile.transport == Transport::loopback) return "it is for the simulated device";
  const bool by_layout = holds(match.usb_by_layout, device.id);
  if (!holds(match.usb, device.id) && !by_layout) return "its ids do not include " + text(device.id);
  if (!match.serial.empty() && match.serial != device.serial)
    return "it is for serial number " + match.serial + ", not " +
           (device.serial.empty() ? "a device without one" : device.serial);
  if (profile.transport == Transport::libusb && device.interface &&
      *device.interface != profile.endpoints.interface)
    return "it speaks over interface " + std::to_string(profile.endpoints.interface) +
           " of the device, this is " + std::to_string(*device.interface);
  std::string why = why_not_by_usage("the usage page", match.usage_page, device.usage_page);
  if (why.empty()) why = why_not_by_usage("the usage", match.usage, device.usage);
  if (!why.empty()) return why;
  if (!device.input_reports.empty()) return why_not_by_reports(profile, device.input_reports);
  return by_layout ? "devices of this id differ, and the report descriptor has not been read" : "";
}

/// How closely a matching profile names the device.
int rank(const DeviceIdentity& device, const DeviceProfile& profile) {
  return (profile.match.serial.empty() ? 0 : 2) + (holds(profile.match.usb, device.id) ? 1 : 0);
}

}  // namespace

bool carries_pose(const PoseReportLayout& r) noexcept {
  return r.position.present || r.orientation.present || r.joints.present || r.translation.present ||
         r.rotation.present;
}

std::string text(UsbId id) {
  return hex(id.vendor) + ":" + hex(id.product);
}

MatchResult match_profile(const DeviceIdentity& device, std::span<const DeviceProfile> profiles,
                          std::string_view named) {
  MatchResult result;
  if (const UnusableDevice* known = find_unusable_device(device.id)) {
    result.refusal = std::string(known->name) + " (" + text(device.id) + "): " + std::string(known->reason);
    result.rejections.assign(profiles.size(), "the device cannot be used");
    return result;
  }
  int best = -1;
  for (std::size_t i = 0; i < profiles.size(); ++i) {
    result.rejections.push_back(why_not(device, profiles[i], named));
    if (!result.rejections.back().empty()) continue;
    const int closeness = rank(device, profiles[i]);
    if (closeness > best) {
      result.profile = i;
      result.refusal.clear();
    } else if (closeness == best) {
      result.profile.reset();
      result.refusal = "several profiles match " + text(device.id) + ", the last of them " +
                       profiles[i].name +
                       "; name one in the configuration, or state the serial number in one";
    }
    best = std::max(best, closeness);
  }
  return result;
}

}  // namespace wrenchd
