// SPDX-License-Identifier: GPL-3.0-or-later
#include "devices/discovery/usb_devices.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <map>
#include <memory>
#include <span>
#include <stdexcept>
#include <tuple>

#include <libudev.h>
#include <unistd.h>

#include "core/files/opened_file.hpp"
#include "devices/discovery/udev_text.hpp"

namespace wrenchd {
namespace {

struct Release {
  void operator()(udev* u) const noexcept { udev_unref(u); }
  void operator()(udev_enumerate* e) const noexcept { udev_enumerate_unref(e); }
  void operator()(udev_device* d) const noexcept { udev_device_unref(d); }
};
using Udev = std::unique_ptr<udev, Release>;
using UdevDevice = std::unique_ptr<udev_device, Release>;

constexpr int kHubClass = 9;

std::string attribute(udev_device* device, const char* name) {
  return udev_text(udev_device_get_sysattr_value(device, name));
}

int number(std::string_view digits, int base) {
  int value = 0;
  std::from_chars(digits.data(), digits.data() + digits.size(), value, base);
  return value;
}

/// Returns all devices of a subsystem, in arbitrary order.
std::vector<UdevDevice> devices_of(udev* context, const char* subsystem) {
  const std::unique_ptr<udev_enumerate, Release> found(udev_enumerate_new(context));
  udev_enumerate_add_match_subsystem(found.get(), subsystem);
  if (udev_enumerate_scan_devices(found.get()) < 0)
    throw std::runtime_error(std::string("udev cannot list the devices of subsystem ") + subsystem +
                             "; is /sys mounted?");
  std::vector<UdevDevice> devices;
  for (udev_list_entry* entry = udev_enumerate_get_list_entry(found.get()); entry != nullptr;
       entry = udev_list_entry_get_next(entry)) {
    // skips a device that was unplugged in the meantime
    if (UdevDevice device(udev_device_new_from_syspath(context, udev_list_entry_get_name(entry))); device)
      devices.push_back(std::move(device));
  }
  return devices;
}

// --- report descriptor ------------------------------------------------------------------------------------

/// Reads the usages and the presence of report ids; report_descriptor.hpp has the full parser.
///
/// HID 1.11, section 6.2.2: an item is a prefix byte - size in bits 0 and 1, type in 2 and 3, tag in 4 to 7 -
/// and 0, 1, 2 or 4 bytes of data. Prefix 0xFE begins a long item: its size follows, then its tag.
void read_descriptor(UsbDevice& device) {
  constexpr std::uint8_t usage_page = 0x04, report_id = 0x84, usage = 0x08, collection = 0xA0,
                         long_item = 0xFE;
  bool in_collection = false;
  std::span<const std::uint8_t> remaining(device.report_descriptor);
  while (!remaining.empty()) {
    const std::uint8_t prefix = remaining[0];
    const bool is_long = prefix == long_item;
    const std::size_t head = is_long ? 3 : 1;
    if (remaining.size() < head) return;
    constexpr std::array<std::size_t, 4> sizes{0, 1, 2, 4};
    const std::size_t size = is_long ? remaining[1] : sizes[prefix & 3U];
    if (remaining.size() < head + size) return;
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < std::min<std::size_t>(size, 4); ++i)
      value |= static_cast<std::uint32_t>(remaining[head + i]) << (8 * i);
    const std::uint8_t item = is_long ? std::uint8_t{0} : static_cast<std::uint8_t>(prefix & 0xFCU);
    if (item == report_id) device.numbered_reports = true;
    if (item == collection) in_collection = true;
    if (item == usage_page && !in_collection) device.usage_page = static_cast<std::uint16_t>(value);
    if (item == usage && !in_collection) {
      device.usage = static_cast<std::uint16_t>(value);
      if (size == 4) device.usage_page = static_cast<std::uint16_t>(value >> 16U);
    }
    remaining = remaining.subspan(head + size);
  }
}

std::vector<std::uint8_t> read_bytes(const std::string& file) {
  const std::string bytes = read_file_if_readable(file).value_or("");
  return {bytes.begin(), bytes.end()};
}

// --- one device -------------------------------------------------------------------------------------------

void read_usb_properties(UsbDevice& device, udev_device* usb) {
  device.port_path = udev_text(udev_device_get_sysname(usb));
  device.usb_node = udev_text(udev_device_get_devnode(usb));
  device.vendor = static_cast<std::uint16_t>(number(attribute(usb, "idVendor"), 16));
  device.product = static_cast<std::uint16_t>(number(attribute(usb, "idProduct"), 16));
  device.serial = without_control_characters(attribute(usb, "serial"));
  device.manufacturer = without_control_characters(attribute(usb, "manufacturer"));
  device.product_name = without_control_characters(attribute(usb, "product"));
}

/// The uevent of a HID device that is not on USB contains its ids: HID_ID=0005:00001209:00006D0F.
void read_hid_properties(UsbDevice& device, udev_device* hid) {
  const std::string id = udev_text(udev_device_get_property_value(hid, "HID_ID"));
  const std::size_t first = id.find(':');
  const std::size_t second = first == std::string::npos ? first : id.find(':', first + 1);
  if (second != std::string::npos) {
    device.vendor = static_cast<std::uint16_t>(number(std::string_view(id).substr(first + 1, 8), 16));
    device.product = static_cast<std::uint16_t>(number(std::string_view(id).substr(second + 1, 8), 16));
  }
  device.serial = without_control_characters(udev_text(udev_device_get_property_value(hid, "HID_UNIQ")));
  device.product_name =
      without_control_characters(udev_text(udev_device_get_property_value(hid, "HID_NAME")));
}

UsbDevice from_hidraw(udev_device* hidraw, udev_device* hid) {
  UsbDevice device;
  device.hidraw_node = udev_text(udev_device_get_devnode(hidraw));
  device.report_descriptor = read_bytes(udev_text(udev_device_get_syspath(hid)) + "/report_descriptor");
  read_descriptor(device);
  return device;
}

/// Returns the numbers in "/dev/hidraw12" or "3-1.10", as a sort key.
std::vector<int> numbers_in(std::string_view s) {
  std::vector<int> numbers;
  for (std::size_t i = 0; i < s.size();) {
    if (std::isdigit(static_cast<unsigned char>(s[i])) == 0) {
      ++i;
      continue;
    }
    int value = 0;
    const auto [end, error] = std::from_chars(s.data() + i, s.data() + s.size(), value);
    numbers.push_back(error == std::errc() ? value : 0);
    i = static_cast<std::size_t>(end - s.data());
  }
  return numbers;
}

std::string hex4(std::uint16_t value) {
  std::array<char, 8> digits{};
  std::snprintf(digits.data(), digits.size(), "%04x", value);
  return digits.data();
}

std::string udev_rule(const UsbDevice& device, const std::string& node) {
  const bool hidraw = node == device.hidraw_node;
  return std::string(R"(SUBSYSTEM==")") + (hidraw ? "hidraw" : "usb") + R"(", ATTR)" + (hidraw ? "S" : "") +
         R"({idVendor}==")" + hex4(device.vendor) + R"(", ATTR)" + (hidraw ? "S" : "") + R"({idProduct}==")" +
         hex4(device.product) + R"(", GROUP="wrenchd", MODE="0660")";
}

}  // namespace

bool UsbDevice::is_same_device(const UsbDevice& other) const {
  return vendor == other.vendor && product == other.product && serial == other.serial &&
         interface == other.interface && report_descriptor == other.report_descriptor;
}

std::vector<UsbDevice> list_usb_devices() {
  const Udev context(udev_new());
  if (!context) throw std::runtime_error("cannot list connected devices through udev: out of memory");
  std::vector<UsbDevice> found;

  // First the HID interfaces, by the path of their USB interface.
  std::map<std::string, std::vector<UsbDevice>> on_usb;
  for (const UdevDevice& hidraw : devices_of(context.get(), "hidraw")) {
    udev_device* const hid = udev_device_get_parent_with_subsystem_devtype(hidraw.get(), "hid", nullptr);
    if (hid == nullptr) continue;
    UsbDevice device = from_hidraw(hidraw.get(), hid);
    udev_device* const interface =
        udev_device_get_parent_with_subsystem_devtype(hidraw.get(), "usb", "usb_interface");
    if (interface != nullptr) {
      on_usb[udev_text(udev_device_get_syspath(interface))].push_back(std::move(device));
    } else {
      read_hid_properties(device, hid);
      found.push_back(std::move(device));
    }
  }

  for (const UdevDevice& interface : devices_of(context.get(), "usb")) {
    if (udev_text(udev_device_get_devtype(interface.get())) != "usb_interface") continue;
    if (number(attribute(interface.get(), "bInterfaceClass"), 16) == kHubClass) continue;
    udev_device* const usb =
        udev_device_get_parent_with_subsystem_devtype(interface.get(), "usb", "usb_device");
    if (usb == nullptr) continue;
    std::vector<UsbDevice>& here = on_usb[udev_text(udev_device_get_syspath(interface.get()))];
    if (here.empty()) here.emplace_back();
    for (UsbDevice& device : here) {
      device.interface = number(attribute(interface.get(), "bInterfaceNumber"), 16);
      read_usb_properties(device, usb);
      found.push_back(std::move(device));
    }
  }

  std::sort(found.begin(), found.end(), [](const UsbDevice& a, const UsbDevice& b) {
    return std::tuple(numbers_in(a.port_path), a.interface, numbers_in(a.hidraw_node)) <
           std::tuple(numbers_in(b.port_path), b.interface, numbers_in(b.hidraw_node));
  });
  return found;
}

std::string without_control_characters(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < ' ' || c == 0x7f; }, '?');
  return text;
}

std::string to_printable(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < ' ' || c > '~'; }, '?');
  return text;
}

std::string describe(const UsbDevice& device) {
  std::string s = hex4(device.vendor) + ":" + hex4(device.product);
  if (!device.serial.empty()) s += " serial " + to_printable(device.serial);
  if (!device.port_path.empty()) s += " in " + device.port_path;
  if (device.interface >= 0) s += ", interface " + std::to_string(device.interface);
  return s;
}

std::string open_error(const UsbDevice& device, const std::string& node) {
  if (access(node.c_str(), R_OK | W_OK) == 0) return {};
  return open_error(device, node, errno);
}

std::string open_error(const UsbDevice& device, const std::string& node, int error) {
  const std::string what = "cannot open " + node + " (" + describe(device) + "): " + std::strerror(error);
  switch (error) {
    case EACCES:
    case EPERM:
      return what + "; add this line to /etc/udev/rules.d/70-wrenchd.rules\n  " + udev_rule(device, node) +
             "\nand join the group wrenchd; then unplug the device and connect it again";
    case ENOENT:
    case ENODEV:
    case ENXIO:
      return what + "; the device is no longer connected";
    case EBUSY:
      return what + "; another program uses it: end that program";
    default:
      return what + "; unplug the device and connect it again, and check the kernel log (dmesg)";
  }
}

std::string port_path_in(std::string_view sys_path) {
  std::string port_path;
  while (!sys_path.empty()) {
    const std::size_t end = std::min(sys_path.find('/'), sys_path.size());
    const std::string_view part = sys_path.substr(0, end);
    const std::size_t dash = part.find('-');
    const auto digits = [](std::string_view s, std::string_view more) {
      return !s.empty() && std::all_of(s.begin(), s.end(), [&](char c) {
        return std::isdigit(static_cast<unsigned char>(c)) != 0 || more.find(c) != std::string_view::npos;
      });
    };
    if (dash != std::string_view::npos && digits(part.substr(0, dash), "") &&
        digits(part.substr(dash + 1), "."))
      port_path = part;
    sys_path.remove_prefix(std::min(end + 1, sys_path.size()));
  }
  return port_path;
}

}  // namespace wrenchd
