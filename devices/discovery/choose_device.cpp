// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/discovery/choose_device.hpp"

#include <algorithm>

#include "devices/discovery/inspected_device.hpp"
#include "devices/discovery/match_profile.hpp"
#include "devices/profile_reports.hpp"

namespace wrenchd {
namespace {

/// A connected device during selection.
struct Candidate {
  std::optional<std::size_t> profile;
  std::string rejection;  ///< empty: the device qualifies
};

std::string serial_text(const UsbDevice& device) {
  return device.serial.empty() ? "no serial number" : "serial number " + device.serial;
}

std::string rejection_by_criteria(const UsbDevice& device, const DeviceCriteria& criteria) {
  if (!criteria.serial.empty() && device.serial != criteria.serial)
    return "the configuration requires serial number " + criteria.serial + ", it has " + serial_text(device);
  if (!criteria.usb_port.empty() && device.port_path != criteria.usb_port)
    return "the configuration requires the USB port " + criteria.usb_port + ", it is in " +
           (device.port_path.empty() ? "none" : device.port_path);
  if (criteria.previous && !device.is_same_device(*criteria.previous))
    return "it is not the device that was unplugged, " + describe(*criteria.previous) +
           "; connect that device again, or restart wrenchd to use this one (wrong_device)";
  return {};
}

std::string rejection_by_descriptor(const InspectedDevice& inspected, const DeviceProfile& profile) {
  if (!inspected.descriptor_error.empty())
    return "its report descriptor is invalid, so the profile " + profile.name +
           " cannot be checked against it: " + inspected.descriptor_error;
  if (!inspected.descriptor) return {};  // no HID device, so it has no descriptor
  std::string text;
  for (const std::string& line : find_differences(*inspected.descriptor, expected_reports(profile)))
    text += (text.empty() ? "" : "; ") + line;
  if (text.empty()) return {};
  return "its report descriptor differs from the profile " + profile.name + ": " + text;
}

Candidate evaluate(const UsbDevice& device, std::span<const DeviceProfile> profiles,
                   const DeviceCriteria& criteria) {
  const InspectedDevice inspected = inspect_device(device);
  const bool serial_named = !criteria.serial.empty() && criteria.serial == device.serial;
  const MatchResult match = match_profile(inspected.identity, profiles, criteria.profile, serial_named);
  if (!match.rejection.empty()) return {{}, match.rejection};
  if (!match.profile) {
    for (std::size_t i = 0; i < profiles.size() && !criteria.profile.empty(); ++i)
      if (profiles[i].name == criteria.profile)
        return {{}, "profile " + criteria.profile + ": " + match.rejections[i]};
    return {{}, "no profile matches; wrenchctl devices prints the reason for each profile"};
  }
  const DeviceProfile& profile = profiles[*match.profile];
  std::string why = rejection_by_criteria(device, criteria);
  if (why.empty()) why = rejection_by_descriptor(inspected, profile);
  return {match.profile, why};
}

}  // namespace

DeviceChoice choose_device(std::span<const UsbDevice> connected, std::span<const DeviceProfile> profiles,
                           const DeviceCriteria& criteria) {
  DeviceChoice choice;
  std::vector<DeviceChoice::Selection> candidates;
  for (std::size_t i = 0; i < connected.size(); ++i) {
    const Candidate candidate = evaluate(connected[i], profiles, criteria);
    choice.rejections.push_back(candidate.rejection);
    if (candidate.profile && candidate.rejection.empty()) candidates.push_back({i, *candidate.profile});
  }
  if (candidates.size() == 1) choice.selection = candidates.front();
  if (candidates.size() < 2) return choice;
  for (const DeviceChoice::Selection& pick : candidates) {
    const UsbDevice& device = connected[pick.device];
    const auto same_serial = std::count_if(candidates.begin(), candidates.end(), [&](const auto& other) {
      return connected[other.device].serial == device.serial;
    });
    const std::string& profile = profiles[pick.profile].name;
    std::string text =
        "it matches the profile " + profile + ", and other devices match too: this is " + serial_text(device);
    if (!device.port_path.empty()) text += " in USB port " + device.port_path;
    text += "; ";
    const bool by_serial = !device.serial.empty() && same_serial == 1;
    if (by_serial || !device.port_path.empty()) {
      text += "select it by profile = \"" + profile + "\" and ";
      text += by_serial ? "serial = \"" + device.serial : "usb_port = \"" + device.port_path;
      text += "\" in [device], or ";
    }
    choice.rejections[pick.device] = text + "unplug the others";
  }
  return choice;
}

}  // namespace wrenchd
