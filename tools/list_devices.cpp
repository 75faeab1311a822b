// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/list_devices.hpp"

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

#include "config/config_error.hpp"
#include "devices/discovery/inspected_device.hpp"
#include "devices/discovery/match_profile.hpp"
#include "devices/discovery/unusable_devices.hpp"
#include "devices/profile_reports.hpp"

namespace wrenchd {
namespace {

constexpr Usage kMultiAxis = {0x01, 0x08};

/// One USB interface, and the result of matching it with the profiles.
struct Entry {
  UsbDevice printable;  ///< the device with printable strings
  InspectedDevice facts;
  MatchResult match;
  bool related = false;           ///< the interface belongs to a supported or related device
  bool matches_if_named = false;  ///< a profile matches if the configuration names it
};

/// The interfaces of one device.
using Interfaces = std::span<const Entry>;

// --- collecting the devices -------------------------------------------------------------------------------

constexpr std::size_t kLongestName = 60, kLongestReason = 400;

std::string short_printable(const std::string& text, std::size_t longest) {
  return printable(wrenchd::to_printable(text), longest);
}

UsbDevice short_printable(UsbDevice device) {
  for (std::string* text : {&device.serial, &device.manufacturer, &device.product_name})
    *text = short_printable(*text, kLongestName);
  return device;
}

Entry entry_of(const UsbDevice& device, const std::vector<DeviceProfile>& profiles) {
  Entry entry{short_printable(device), inspect_device(device), {}, false, false};
  entry.match = match_profile(entry.facts.identity, profiles);
  entry.matches_if_named = std::any_of(profiles.begin(), profiles.end(), [&](const DeviceProfile& profile) {
    return match_profile(entry.facts.identity, std::span(&profile, 1), profile.name).profile.has_value();
  });
  const bool multi_axis = Usage{device.usage_page, device.usage} == kMultiAxis;
  entry.related = entry.match.profile || !entry.match.rejection.empty() || multi_axis ||
                  std::any_of(profiles.begin(), profiles.end(), [&](const DeviceProfile& profile) {
                    return lists_id(profile, entry.facts.identity.id);
                  });
  return entry;
}

bool same_socket(const UsbDevice& a, const UsbDevice& b) {
  return !a.port_path.empty() && a.port_path == b.port_path && a.vendor == b.vendor && a.product == b.product;
}

/// Groups the interfaces. The interfaces of one device are adjacent in the list.
std::vector<Interfaces> by_device(const std::vector<Entry>& entries) {
  std::vector<Interfaces> devices;
  for (std::size_t i = 0; i < entries.size();) {
    std::size_t end = i + 1;
    while (end < entries.size() && same_socket(entries[i].printable, entries[end].printable)) ++end;
    devices.push_back(Interfaces(entries).subspan(i, end - i));
    i = end;
  }
  return devices;
}

/// Returns the interfaces that the list describes: those with a profile, otherwise the first one that a
/// profile would match if the configuration named it, otherwise the first related one. The others have the
/// same id and would repeat its text.
std::vector<const Entry*> described_interfaces(Interfaces device, bool all) {
  std::vector<const Entry*> found;
  for (const Entry& entry : device)
    if (all || entry.match.profile) found.push_back(&entry);
  if (!found.empty()) return found;
  const auto nameable =
      std::find_if(device.begin(), device.end(), [](const Entry& entry) { return entry.matches_if_named; });
  if (nameable != device.end()) return {&*nameable};
  const auto with_usage = std::find_if(device.begin(), device.end(), [](const Entry& entry) {
    return entry.related && Usage{entry.printable.usage_page, entry.printable.usage} == kMultiAxis;
  });
  if (with_usage != device.end()) return {&*with_usage};
  const auto first =
      std::find_if(device.begin(), device.end(), [](const Entry& entry) { return entry.related; });
  if (first != device.end()) found.push_back(&*first);
  return found;
}

// --- describing a device ----------------------------------------------------------------------------------

std::string indented(const std::string& text) {
  std::string lines = "  ";
  for (const char c : text) lines += c == '\n' ? "\n  " : std::string(1, c);
  return lines + '\n';
}

std::string where(const UsbDevice& device) {
  if (!device.port_path.empty()) return device.port_path;
  return device.hidraw_node.empty() ? "not on USB" : device.hidraw_node + " (not on USB)";
}

std::string who(const UsbDevice& device) {
  std::string text = wrenchd::text(UsbId{device.vendor, device.product});
  if (!device.product_name.empty()) text += " \"" + device.product_name + "\"";
  if (!device.manufacturer.empty()) text += " of " + device.manufacturer;
  return text;
}

std::string device_head(const UsbDevice& device) {
  return where(device) + (device.interface < 0 ? "" : ", interface " + std::to_string(device.interface)) +
         ": " + who(device) +
         (device.serial.empty() ? ", no serial number" : ", serial number " + device.serial) + '\n';
}

std::string in_one_line(Interfaces device) {
  const UsbDevice& first = device.front().printable;
  std::vector<std::string> kinds;
  for (const Entry& entry : device) {
    if (entry.printable.report_descriptor.empty()) continue;
    const std::string kind = to_text(Usage{entry.printable.usage_page, entry.printable.usage});
    if (std::find(kinds.begin(), kinds.end(), kind) == kinds.end()) kinds.push_back(kind);
  }
  std::string text = where(first) + ": " + who(first);
  for (const std::string& kind : kinds) text += ", " + kind;
  return text + (kinds.empty() ? ", not HID" : "") + "; no profile matches\n";
}

/// Returns whether wrenchd may open the node that the transport uses.
std::string access(const UsbDevice& device, Transport transport, const OpenCheck& why_not_open) {
  const bool hidraw = transport == Transport::hidraw;
  const std::string& node = hidraw ? device.hidraw_node : device.usb_node;
  if (node.empty())
    return indented(
        hidraw
            ? "the device has no hidraw node because no HID driver handles it; reconnect it, then check "
              "the kernel messages (dmesg)"
            : "the device has no USB node, which the profile's transport libusb requires; connect it with a "
              "cable");
  const std::string why = why_not_open(device, node);
  return indented(why.empty() ? node + " can be opened" : why);
}

/// Returns whether wrenchd may open the preferred node of a device without a profile.
std::string access(const UsbDevice& device, const OpenCheck& why_not_open) {
  return access(device, device.hidraw_node.empty() ? Transport::libusb : Transport::hidraw, why_not_open);
}

std::string degrees_of_freedom(const DeviceProfile& profile) {
  const DofMask sensed = sensed_dofs(profile), driven = driven_dofs(profile);
  const auto others = [](DofMask dofs) { return dof_text(static_cast<DofMask>(kAllDofs & ~dofs)); };
  std::string text = "senses " + dof_text(sensed) + "; drives " + dof_text(driven);
  if (sensed != kAllDofs) text += "; the pose stays constant along " + others(sensed);
  if (driven == kNoDof)
    text += ": the device moves a tool, and wrenchd drops every wrench";
  else if (driven != kAllDofs)
    text += "; wrenchd drops " + others(driven) + " of every wrench";
  return indented(text);
}

/// Returns the result of comparing the profile with the device's report descriptor.
std::string agreement(const InspectedDevice& facts, const DeviceProfile& profile) {
  if (!facts.descriptor_error.empty())
    return indented("the report descriptor is invalid, so it cannot be compared with the profile: " +
                    facts.descriptor_error);
  if (!facts.descriptor)
    return indented("the device is not HID, so there is no report descriptor to compare with the profile");
  const auto lines = find_differences(*facts.descriptor, expected_reports(profile));
  if (lines.empty()) return indented("the report descriptor agrees with the profile");
  std::string text =
      "the report descriptor disagrees with the profile; change the profile, unless it belongs to another "
      "device:";
  for (const std::string& line : lines) text += "\n  " + line;
  return indented(text);
}

/// Returns the reasons for rejection. Profiles with the same reason share a line.
std::string why_not(const Entry& entry, const std::vector<DeviceProfile>& profiles) {
  std::vector<std::pair<std::string, std::string>> names_by_reason;
  for (std::size_t i = 0; i < profiles.size(); ++i) {
    if (entry.match.profile == i) continue;
    std::string reason = short_printable(entry.match.rejections[i], kLongestReason);
    if (reason.empty())
      reason = entry.match.profile ? "this profile also matches, but less specifically"
                                   : "this profile also matches";
    const auto same = std::find_if(names_by_reason.begin(), names_by_reason.end(),
                                   [&](const auto& pair) { return pair.first == reason; });
    if (same == names_by_reason.end())
      names_by_reason.emplace_back(reason, profiles[i].name);
    else
      same->second += ", " + profiles[i].name;
  }
  std::string text;
  for (const auto& [reason, names] : names_by_reason)
    text.append("    ").append(names).append(": ").append(reason).append("\n");
  return text;
}

std::string paragraph_of_matched(const Entry& entry, const DeviceProfile& profile) {
  return indented("profile " + profile.name +
                  (profile.description.empty() ? "" : ": " + profile.description)) +
         degrees_of_freedom(profile) + agreement(entry.facts, profile);
}

std::string entry_paragraph(const Entry& entry, const std::vector<DeviceProfile>& profiles,
                            const OpenCheck& why_not_open) {
  const UsbDevice& device = entry.printable;
  const std::string begin = device_head(device);
  if (entry.match.profile) {
    const DeviceProfile& profile = profiles[*entry.match.profile];
    const std::string others = why_not(entry, profiles);
    return begin + access(device, profile.transport, why_not_open) + paragraph_of_matched(entry, profile) +
           (others.empty() ? "" : "  the other profiles:\n" + others);
  }
  if (find_unusable_device(entry.facts.identity.id) != nullptr)
    return begin + indented(entry.match.rejection) +
           indented("wrenchd does not open this device, independent of profiles");
  std::string text = begin + access(device, why_not_open);
  if (!entry.facts.descriptor_error.empty())
    text += indented("the report descriptor is invalid: " + entry.facts.descriptor_error);
  text += indented(entry.match.rejection.empty() ? "no profile matches:" : entry.match.rejection);
  text += why_not(entry, profiles);
  if (entry.match.rejection.empty() && entry.facts.descriptor && !device.hidraw_node.empty())
    text += indented("wrenchctl profile --from " + device.hidraw_node + " proposes one");
  return text;
}

// --- notes below the list ---------------------------------------------------------------------------------

/// Returns the devices that share a profile, and how to distinguish them.
std::string equal_devices(const std::vector<Entry>& entries, const std::vector<DeviceProfile>& profiles) {
  std::string text;
  for (std::size_t i = 0; i < profiles.size(); ++i) {
    std::vector<std::string> serials;
    for (const Entry& entry : entries)
      if (entry.match.profile == i) serials.push_back(entry.printable.serial);
    if (serials.size() < 2) continue;
    const std::set<std::string> different(serials.begin(), serials.end());
    text += std::to_string(serials.size()) + " devices have the profile " + profiles[i].name;
    if (different.size() < serials.size() || different.count("") != 0) {
      text +=
          ", and no serial numbers to distinguish them: set usb_port in [device] of wrenchd.toml, or "
          "connect only the intended device\n";
      continue;
    }
    text += ": to select one of them, write a profile with inherits = \"" + profiles[i].name +
            "\" and its serial in [match]:";
    for (const std::string& serial : different) text += " \"" + serial + '"';
    text += '\n';
  }
  return text;
}

std::string about_profiles(const KnownProfiles& known) {
  std::string text;
  if (known.profiles.empty()) text += "There are no profiles.\n";
  if (known.rejected.empty()) return text;
  text += "Invalid profiles, which were ignored:\n";
  for (const std::string& why : known.rejected) text += indented(why);
  return text;
}

}  // namespace

std::string device_list(std::span<const UsbDevice> devices, const KnownProfiles& known, bool all,
                        const OpenCheck& why_not_open) {
  std::vector<Entry> entries;
  for (const UsbDevice& device : devices) entries.push_back(entry_of(device, known.profiles));

  std::string paragraphs, lines;
  for (const Interfaces device : by_device(entries)) {
    const auto tell = described_interfaces(device, all);
    for (const Entry* entry : tell)
      paragraphs += entry_paragraph(*entry, known.profiles, why_not_open) + '\n';
    if (tell.empty()) lines += in_one_line(device);
  }
  std::string text = paragraphs;
  if (entries.empty()) text += "No device is connected: no USB device except hubs, and no HID device.\n";
  if (!lines.empty() && paragraphs.empty()) text += "No known device is connected.\n";
  if (!lines.empty())
    text +=
        "Other devices (--all shows the rejection reasons):\n" + indented(lines.substr(0, lines.size() - 1));
  for (const std::string& part : {equal_devices(entries, known.profiles), about_profiles(known)})
    if (!part.empty()) text += (text.ends_with("\n\n") ? "" : "\n") + part;
  while (text.ends_with("\n\n")) text.pop_back();
  return text;
}

}  // namespace wrenchd
