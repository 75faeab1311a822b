// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/udev_rules.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <map>
#include <string_view>
#include <utility>
#include <vector>

#include "daemon/version.hpp"
#include "devices/discovery/unusable_devices.hpp"

namespace wrenchd {
namespace {

/// For usage pages from here on the kernel creates no input device.
constexpr std::uint16_t kFirstVendorPage = 0xff00;

/// Requirements of all profiles with one id.
struct Wanted {
  std::vector<std::string> profiles;
  bool hidraw = false;
  bool libusb = false;
  bool motors = false;
  bool input = false;   ///< the kernel may treat the device as a pointer
  bool starts = false;  ///< connecting the device starts the service
};

using WantedById = std::map<std::pair<std::uint16_t, std::uint16_t>, Wanted>;

void want(WantedById& wanted, const DeviceProfile& profile, UsbId id) {
  // Wrenchd never opens this device, independent of profiles.
  if (find_unusable_device(id) != nullptr) return;
  Wanted& w = wanted[{id.vendor, id.product}];
  if (std::find(w.profiles.begin(), w.profiles.end(), profile.name) != w.profiles.end()) return;
  w.profiles.push_back(profile.name);
  w.hidraw = w.hidraw || profile.transport == Transport::hidraw;
  w.libusb = w.libusb || profile.transport == Transport::libusb;
  w.motors = w.motors || profile.has_output;
  w.input = w.input || (profile.transport == Transport::hidraw &&
                        profile.match.usage_page.value_or(0) < kFirstVendorPage);
  w.starts = w.starts || !profile.match.only_when_named;
}

std::string hex4(std::uint16_t value, const char* format) {
  std::array<char, 8> digits{};
  std::snprintf(digits.data(), digits.size(), format, value);
  return digits.data();
}

std::string block(std::uint16_t vendor, std::uint16_t product, const Wanted& w) {
  const std::string v = hex4(vendor, "%04x"), p = hex4(product, "%04x");
  const std::string usb_device = R"(SUBSYSTEM=="usb", ENV{DEVTYPE}=="usb_device", ATTR{idVendor}==")" + v +
                                 R"(", ATTR{idProduct}==")" + p + "\", ";
  const std::string node = std::string(R"(GROUP="wrenchd", MODE="0660")") +
                           (w.motors ? R"(, TAG-="uaccess")" : "") +
                           (w.starts ? R"(, TAG+="systemd", ENV{SYSTEMD_WANTS}+="wrenchd.service")" : "");
  std::string text = "\n# " + v + ":" + p + ":";
  for (const std::string& name : w.profiles) text += " " + name;
  // Matches the HID layer's name bus:vendor:product.number, which also exists for Bluetooth.
  if (w.hidraw)
    text += "\nSUBSYSTEM==\"hidraw\", KERNELS==\"*:" + hex4(vendor, "%04X") + ":" + hex4(product, "%04X") +
            ".*\", " + node;
  if (w.libusb) text += "\n" + usb_device + node;
  text += "\n" + usb_device + R"(TEST=="power/control", ATTR{power/control}="on")";
  if (w.input)
    text += R"(
SUBSYSTEM=="input", ATTRS{idVendor}==")" +
            v + R"(", ATTRS{idProduct}==")" + p + R"(", ENV{LIBINPUT_IGNORE_DEVICE}="1")";
  return text + "\n";
}

}  // namespace

std::string udev_rules(std::span<const DeviceProfile> profiles) {
  WantedById wanted;
  for (const DeviceProfile& profile : profiles) {
    if (profile.transport == Transport::loopback) continue;
    for (const auto* ids : {&profile.match.usb, &profile.match.usb_by_layout})
      for (const UsbId id : *ids) want(wanted, profile, id);
  }
  std::string text = std::string("# wrenchd ") + kVersion +
                     R"(: devices that it has a profile for. Made by `wrenchctl udev-rules`; do not edit.
#
# For profiles of your own: wrenchctl udev-rules -o /etc/udev/rules.d/70-wrenchd.rules, which then stands in the
# place of this file; udevadm trigger has it take hold of what is plugged in.

ACTION=="remove", GOTO="wrenchd_end"
)";
  for (const auto& [id, w] : wanted) text += block(id.first, id.second, w);
  return text + "\nLABEL=\"wrenchd_end\"\n";
}

}  // namespace wrenchd
