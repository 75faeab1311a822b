// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/discovery/choose_device.hpp"

#include "devices/discovery/inspected_device.hpp"
#include "devices/discovery/match_profile.hpp"
#include "devices/profile_reports.hpp"

namespace wrenchd {
namespace {

/// One plugged-in device, while it is looked at.
struct Candidate {
  std::optional<std::size_t> profile;
  std::string why_not;  ///< empty: it may be the one
};

std::string serial_text(const UsbDevice& device) {
  return device.serial.empty() ? "no serial number" : "serial number " + device.serial;
}

std::string why_not_by_device(const UsbDevice& device, const DeviceCriteria& wanted) {
  if (!wanted.serial.empty() && device.serial != wanted.serial)
    return "the configuration wants serial number " + wanted.serial + ", it has " + serial_text(device);
  if (wanted.previous && !device.is_same_device(*wanted.previous))
    return "it is not the device that was unplugged, " + describe(*wanted.previous) +
           "; plug that one in again, or start wrenchd anew to use this one (wrong_device)";
  return {};
}

std::string why_not_by_descriptor(const InspectedDevice& facts, const DeviceProfile& profile) {
  if (!facts.descriptor_error.empty())
    return "its report descriptor is refused, so the profile " + profile.name +
           " cannot be held against it: " + facts.descriptor_error;
  if (!facts.descriptor) return {};  // it is not HID, and has none
  std::string text;
  for (const std::string& line : find_differences(*facts.descriptor, expected_reports(profile)))
    text += (text.empty() ? "" : "; ") + line;
  if (text.empty()) return {};
  return "its report descriptor disagrees with the profile " + profile.name + ": " + text;
}

Candidate look_at(const UsbDevice& device, std::span<const DeviceProfile> profiles,
                  const DeviceCriteria& wanted) {
  const InspectedDevice facts = inspect_device(device);
  const MatchResult match = match_profile(facts.identity, profiles, wanted.profile);
  if (!match.refusal.empty()) return {{}, match.refusal};
  if (!match.profile) {
    for (std::size_t i = 0; i < profiles.size() && !wanted.profile.empty(); ++i)
      if (profiles[i].name == wanted.profile)
        return {{}, "profile " + wanted.profile + ": " + match.rejections[i]};
    return {{}, "no profile is for it; wrenchctl devices tells why of each"};
  }
  const DeviceProfile& profile = profiles[*match.profile];
  std::string why = why_not_by_device(device, wanted);
  if (why.empty()) why = why_not_by_descriptor(facts, profile);
  return {match.profile, why};
}

}  // namespace

DeviceChoice choose_device(std::span<const UsbDevice> plugged, std::span<const DeviceProfile> profiles,
                           const DeviceCriteria& wanted) {
  DeviceChoice choice;
  std::vector<DeviceChoice::Selection> fitting;
  for (std::size_t i = 0; i < plugged.size(); ++i) {
    const Candidate candidate = look_at(plugged[i], profiles, wanted);
    choice.rejections.push_back(candidate.why_not);
    if (candidate.profile && candidate.why_not.empty()) fitting.push_back({i, *candidate.profile});
  }
  if (fitting.size() == 1) choice.selection = fitting.front();
  if (fitting.size() < 2) return choice;
  for (const DeviceChoice::Selection& pick : fitting)
    choice.rejections[pick.device] =
        "it fits, with the profile " + profiles[pick.profile].name + ", and is not alone: this is " +
        serial_text(plugged[pick.device]) +
        "; name the profile and the serial number in [device], or unplug the others";
  return choice;
}

}  // namespace wrenchd
