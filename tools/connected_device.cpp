// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/connected_device.hpp"

#include <stdexcept>
#include <vector>

#include "config/known_profiles.hpp"
#include "config/load_profile.hpp"
#include "config/settings.hpp"
#include "devices/links/reconnecting_link.hpp"

namespace wrenchd {
namespace {

std::vector<DeviceProfile> profiles_named(const std::string& name) {
  if (name == kAnyProfile) return known_profiles(SearchPath()).profiles;
  const DeviceProfile profile = load_profile_named(name);
  if (profile.transport == Transport::loopback)
    throw std::runtime_error("profile " + profile.name +
                             ": it is for the simulated device; name the profile of a real device");
  return {profile};
}

std::vector<UsbDevice> devices_at(const std::string& hidraw_node) {
  std::vector<UsbDevice> devices = list_usb_devices();
  if (hidraw_node.empty()) return devices;
  std::erase_if(devices, [&](const UsbDevice& device) { return device.hidraw_node != hidraw_node; });
  if (devices.empty())
    throw std::runtime_error(hidraw_node +
                             " is no connected HID device; wrenchctl devices lists their nodes");
  return devices;
}

}  // namespace

ConnectedDevice find_connected_device(const std::string& profile, const std::string& serial,
                                      const std::string& hidraw_node) {
  const std::vector<DeviceProfile> profiles = profiles_named(profile);
  const std::vector<UsbDevice> connected = devices_at(hidraw_node);
  DeviceCriteria criteria;
  criteria.serial = serial;
  if (profile != kAnyProfile) criteria.profile = profiles.front().name;
  const DeviceChoice choice = choose_device(connected, profiles, criteria);
  if (choice.selection) return {profiles[choice.selection->profile], connected[choice.selection->device]};
  std::string text = "no such device is connected; wrenchctl devices lists the connected devices";
  for (const std::string& rejected : describe_rejected(connected, choice)) text += "\n  " + rejected;
  throw std::runtime_error(text);
}

}  // namespace wrenchd
