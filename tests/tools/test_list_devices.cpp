// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cerrno>
#include <cstdlib>

#include <catch2/catch.hpp>

#include "tests/support/hex_text.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/sample_descriptors.hpp"
#include "tools/list_devices.hpp"

namespace wrenchd::test_list_devices {

namespace {

using namespace test;
using Catch::Contains;

const KnownProfiles kShipped = known_profiles(SearchPath({test::source_path("config")}));

struct Ids {
  std::uint16_t vendor, product, page, usage;
};

/// A connected HID device; the node numbers are the port number.
UsbDevice hid(int port, Ids ids, const Bytes& descriptor, const std::string& name) {
  UsbDevice device;
  device.port_path = "3-" + std::to_string(port);
  device.hidraw_node = "/dev/hidraw" + std::to_string(port);
  device.usb_node = "/dev/bus/usb/003/00" + std::to_string(port);
  device.interface = 0;
  device.vendor = ids.vendor;
  device.product = ids.product;
  device.product_name = name;
  device.report_descriptor = descriptor;
  device.usage_page = ids.page;
  device.usage = ids.usage;
  return device;
}

UsbDevice space_navigator_in(int port) {
  UsbDevice device = hid(port, {0x046d, 0xc626, 1, 8}, space_navigator(), "SpaceNavigator");
  device.manufacturer = "3Dconnexion";
  return device;
}

UsbDevice reference_in(int port, const std::string& serial) {
  UsbDevice device = hid(port, {0x1209, 0x0001, 0xff00, 1}, reference_descriptor(), "handle");
  device.serial = serial;
  return device;
}

UsbDevice keyboard_in(int port) {
  return hid(port, {0x04d9, 0x1702, 1, 6}, boot_keyboard(), "USB Keyboard");
}

std::string open_to_all(const UsbDevice&, const std::string&) {
  return {};
}

std::string open_to_root(const UsbDevice& device, const std::string& node) {
  return open_error(device, node, EACCES);
}

std::string list(const std::vector<UsbDevice>& devices, bool all = false,
                 const OpenCheck& open = open_to_all) {
  return device_list(devices, kShipped, all, open);
}

bool holds(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST_CASE("the list states that no device is connected", "[list_devices]") {
  CHECK(list({}) == "No device is connected: no USB device except hubs, and no HID device.\n");
  CHECK(list({}, true) == list({}));
}

TEST_CASE("a SpaceNavigator is listed with profile, degrees of freedom and rejected profiles",
          "[list_devices]") {
  CHECK(list({space_navigator_in(2)}) ==
        "3-2, interface 0: 046d:c626 \"SpaceNavigator\" of 3Dconnexion, no serial number\n"
        "  /dev/hidraw2 can be opened\n"
        "  profile spacemouse_split: 3Dconnexion SpaceMouse family, translation and rotation in two reports: "
        "steers a tool, no force\n"
        "  senses x y z rx ry rz; drives none: the device moves a tool, and wrenchd drops every wrench\n"
        "  the report descriptor agrees with the profile\n"
        "  the other profiles:\n"
        "    example, falcon, polhem, polhem_lpc1768, reference_full_speed, reference_high_speed: its ids do "
        "not include 046d:c626\n"
        "    loopback: it is for the simulated device\n"
        "    spacemouse_combined: input report 1 of the device has 7 bytes, in the profile 13\n"
        "    woodenhaptics: it is used only if the configuration names it\n");
}

TEST_CASE("the report descriptor identifies a device with a copied id", "[list_devices]") {
  const std::string text =
      list({hid(1, {0x046d, 0xc62b, 1, 8}, home_made_combined(), "home-made SpaceMouse")});
  CHECK(holds(text, "\n  profile spacemouse_combined: "));
  CHECK(holds(text, "\n  the report descriptor agrees with the profile\n"));
  CHECK(holds(text, "\n    spacemouse_split: input report 1 of the device has 13 bytes, in the profile 7\n"));
}

TEST_CASE("serial numbers distinguish two equal devices", "[list_devices]") {
  const std::string text = list({reference_in(1, "B2"), reference_in(2, "A1")});
  CHECK(holds(text, "3-1, interface 0: 1209:0001 \"handle\", serial number B2\n"));
  CHECK(holds(text, "3-2, interface 0: 1209:0001 \"handle\", serial number A1\n"));
  CHECK(holds(text, "\n  senses x y z rx ry rz; drives x y z rx ry rz\n"));
  CHECK(holds(text,
              "\n\n2 devices have the profile reference_full_speed: to select one of them, write a profile "
              "with inherits = \"reference_full_speed\" and its serial in [match]: \"A1\" \"B2\"\n"));

  const std::string cure =
      ", and no serial numbers to distinguish them: set usb_port in [device] of wrenchd.toml, "
      "or connect only the intended device\n";
  CHECK(holds(list({reference_in(1, "A1"), reference_in(2, "A1")}), cure));
  CHECK(holds(list({reference_in(1, ""), reference_in(2, "A1")}), cure));
  CHECK_FALSE(holds(list({reference_in(1, "A1"), space_navigator_in(2)}), "devices have the profile"));
}

TEST_CASE("a profile that states the serial number goes to that device", "[list_devices]") {
  KnownProfiles known = kShipped;
  const auto shipped = std::find_if(known.profiles.begin(), known.profiles.end(),
                                    [](const auto& p) { return p.name == "reference_full_speed"; });
  REQUIRE(shipped != known.profiles.end());
  DeviceProfile mine = *shipped;
  mine.name = "mine";
  mine.match.serial = "A1";
  known.profiles.push_back(mine);
  const std::string text =
      device_list(std::vector{reference_in(1, "A1"), reference_in(2, "B2")}, known, false, open_to_all);
  const std::size_t second = text.find("3-2, ");
  CHECK(holds(text.substr(0, second), "\n  profile mine: "));
  CHECK(holds(text.substr(0, second),
              "\n    reference_full_speed: this profile also matches, but less specifically\n"));
  CHECK(holds(text.substr(second), "\n  profile reference_full_speed: "));
  CHECK(holds(text.substr(second), "\n    mine: it is for serial number A1, not B2\n"));

  known.profiles.back().match.serial.clear();
  const std::string both = device_list(std::vector{reference_in(1, "A1")}, known, false, open_to_all);
  CHECK(holds(both, "\n  several profiles match 1209:0001, the last of them mine; name one"));
  CHECK(holds(both, "\n    reference_full_speed, mine: this profile also matches\n"));
}

TEST_CASE("devices with fewer degrees of freedom list the missing ones", "[list_devices]") {
  // The id does not identify a Polhem: the user must name it.
  const std::string teensy = list({hid(4, {0x16c0, 0x0486, 0xffab, 0x0200}, teensy_rawhid(), "RawHID")});
  CHECK(holds(teensy, "\n    polhem: 16c0:0486 is the id of every Teensy of PJRC"));
  CHECK(holds(teensy, "set profile = \"polhem\" in [device] of wrenchd.toml"));
  CHECK(holds(teensy, "\n    woodenhaptics: it is used only if the configuration names it\n"));
  KnownProfiles own = known_profiles(SearchPath({test::source_path("config")}));
  for (DeviceProfile& profile : own.profiles)
    if (profile.name == "polhem") profile.match.product = "RawHID";
  const std::string polhem =
      device_list(std::vector{hid(4, {0x16c0, 0x0486, 0xffab, 0x0200}, teensy_rawhid(), "RawHID")}, own,
                  false, open_to_all);
  CHECK(holds(polhem, "\n  profile polhem: "));
  CHECK(holds(polhem, "\n  senses x y z rx ry rz; drives x y z; wrenchd drops rx ry rz of every wrench\n"));
  CHECK(holds(polhem, "\n  the report descriptor agrees with the profile\n"));

  UsbDevice falcon = hid(5, {0x0403, 0xcb48, 0, 0}, {}, "FALCON HAPTIC");
  falcon.hidraw_node.clear();
  const std::string text = list({falcon});
  CHECK(holds(text, "\n  /dev/bus/usb/003/005 can be opened\n  profile falcon: "));
  CHECK(holds(
      text,
      "\n  senses x y z; drives x y z; the pose stays constant along rx ry rz; wrenchd drops rx ry rz of "
      "every wrench\n"));
  CHECK(holds(text,
              "\n  the device is not HID, so there is no report descriptor to compare with the profile\n"));
}

TEST_CASE("closed devices are named and rejected, without advice to open them", "[list_devices]") {
  UsbDevice touch = hid(3, {0x2988, 0x0304, 0xff00, 1}, teensy_rawhid(), "Touch");
  UsbDevice second = touch;
  second.interface = 1;
  CHECK(list({touch, second}, false, open_to_root) ==
        "3-3, interface 0: 2988:0304 \"Touch\", no serial number\n"
        "  3D Systems Touch (HID) (2988:0304): its protocol is not public; use the manufacturer's driver, "
        "or ask the manufacturer to publish the protocol\n"
        "  wrenchd does not open this device, independent of profiles\n");
}

TEST_CASE("an unrelated device has one line, and --all shows the rejection reasons", "[list_devices]") {
  UsbDevice keys = hid(6, {0x04d9, 0x1702, 1, 2}, boot_keyboard(), "USB Keyboard");  // its second interface
  keys.interface = 1;
  UsbDevice disk = hid(7, {0x0781, 0x5581, 0, 0}, {}, "Ultra");
  disk.hidraw_node.clear();
  const std::vector<UsbDevice> devices = {keyboard_in(6), keys, disk};
  CHECK(list(devices) ==
        "No known device is connected.\n"
        "Other devices (--all shows the rejection reasons):\n"
        "  3-6: 04d9:1702 \"USB Keyboard\", 01:06 (keyboard), 01:02 (mouse); no profile matches\n"
        "  3-7: 0781:5581 \"Ultra\", not HID; no profile matches\n");
  const std::string all = list(devices, true);
  CHECK(holds(all, "3-6, interface 0: "));
  CHECK(holds(all, "3-6, interface 1: "));
  CHECK(holds(all, "3-7, interface 0: "));
  CHECK(holds(all, "spacemouse_combined, spacemouse_split: its ids do not include 04d9:1702\n"));
  CHECK(holds(all, "its ids do not include 0781:5581\n"));
  CHECK(holds(list({space_navigator_in(1), keyboard_in(2)}), "\n\nOther devices (--all"));
}

TEST_CASE("a device without access is listed with the udev rule", "[list_devices]") {
  const std::string text = list({space_navigator_in(2)}, false, open_to_root);
  CHECK(holds(
      text,
      "\n  cannot open /dev/hidraw2 (046d:c626 in 3-2, interface 0): Permission denied; add this line to "
      "/etc/udev/rules.d/70-wrenchd.rules\n"
      "    SUBSYSTEM==\"hidraw\", ATTRS{idVendor}==\"046d\", ATTRS{idProduct}==\"c626\", "
      "GROUP=\"wrenchd\", MODE=\"0660\"\n"
      "  and join the group wrenchd; "));
  CHECK_FALSE(holds(text, "can be opened"));

  UsbDevice without = space_navigator_in(2);
  without.hidraw_node.clear();
  CHECK(holds(list({without}),
              "\n  the device has no hidraw node because no HID driver handles it; reconnect it, "));
  UsbDevice high_speed = hid(1, {0x1209, 0x0002, 0xff00, 1}, reference_descriptor(), "handle");
  CHECK(holds(list({high_speed}, false, open_to_root), R"(SUBSYSTEM=="usb", ATTR{idVendor}=="1209")"));
}

TEST_CASE("differences between profile and report descriptor are listed line by line", "[list_devices]") {
  // Ids and input report agree; the output report is one byte too short.
  const Bytes shorter = from_hex(
      "06 00 ff 09 01 a1 01 15 00 26 ff 00 75 08 85 01 09 02 95 3f 81 02 85 02 09 03 95 1e 91 02 c0");
  const std::string text = list({hid(1, {0x1209, 0x0001, 0xff00, 1}, shorter, "handle")});
  CHECK(holds(text,
              "\n  the report descriptor disagrees with the profile; change the profile, unless it belongs "
              "to another "
              "device:\n    output report 0x02: the profile has 32 bytes, the device 31\n    output report "
              "0x02, "));
  Bytes cut = reference_descriptor();
  cut.pop_back();
  CHECK(holds(list({hid(1, {0x1209, 0x0001, 0xff00, 1}, cut, "handle")}),
              "\n  the report descriptor is invalid, so it cannot be compared with the profile: byte 30: "));
}

TEST_CASE("a controller without a profile is listed with the command that proposes one", "[list_devices]") {
  const std::string text = list({hid(8, {0x1d50, 0x6018, 1, 8}, ten_bit_axes(), "home-made")});
  CHECK(holds(text, "\n  no profile matches:\n    example, falcon, "));
  CHECK(holds(text, "\n  wrenchctl profile --from /dev/hidraw8 proposes one\n"));
}

TEST_CASE("only the relevant interfaces of a device are listed", "[list_devices]") {
  UsbDevice keys = hid(2, {0x046d, 0xc626, 1, 6}, boot_keyboard(), "SpaceNavigator");
  UsbDevice axes = space_navigator_in(2);
  axes.interface = 1;
  const std::string text = list({keys, axes});
  CHECK(text.find("3-2, interface 1: ") == 0);
  CHECK_FALSE(holds(text, "interface 0"));
  CHECK(holds(list({keys, axes}, true),
              "spacemouse_combined, spacemouse_split: the usage is 0006, the profile requires 0008"));

  // The Teensy's other interface comes first and also has the ids of the profile.
  UsbDevice console = hid(3, {0x16c0, 0x0486, 0xffc9, 4}, teensy_rawhid(), "RawHID");
  UsbDevice raw = hid(3, {0x16c0, 0x0486, 0xffab, 0x0200}, teensy_rawhid(), "RawHID");
  raw.interface = 1;
  CHECK(list({console, raw}).find("3-3, interface 1: ") == 0);
  CHECK(holds(list({console}), "    polhem: the usage page is ffc9, the profile requires ffab\n"));
}

TEST_CASE("a device that is not on USB is found by its node", "[list_devices]") {
  UsbDevice device = hid(9, {0x256f, 0xc63a, 1, 8}, space_mouse_wireless(), "SpaceMouse Wireless BT");
  device.port_path.clear();
  device.usb_node.clear();
  device.interface = -1;
  const std::string text = list({device});
  CHECK(text.find("/dev/hidraw9 (not on USB): 256f:c63a ") == 0);
  CHECK(holds(text, "\n  profile spacemouse_combined: "));
  UsbDevice other = device;  // two nodes are two devices, although neither has a port path
  CHECK(holds(list({device, other}), "2 devices have the profile spacemouse_combined"));
  UsbDevice keys = keyboard_in(9);
  keys.port_path.clear();
  CHECK(holds(list({keys, keys}), "keyboard); no profile matches\n  /dev/hidraw9 (not on USB): 04d9:1702 "));
}

TEST_CASE("invalid profiles are listed below the devices", "[list_devices]") {
  KnownProfiles known = kShipped;
  known.rejected = {"profiles/mine.toml:3:1: key 'x' is not known"};
  const std::string text = device_list(std::vector{space_navigator_in(1)}, known, false, open_to_all);
  CHECK(holds(text, "\n  profile spacemouse_split: "));
  CHECK(
      text.ends_with("\n\nInvalid profiles, which were ignored:\n"
                     "  profiles/mine.toml:3:1: key 'x' is not known\n"));
  CHECK(holds(device_list({}, {}, false, open_to_all), "There are no profiles.\n"));
}

TEST_CASE("control characters from devices are not printed", "[list_devices]") {
  UsbDevice device = space_navigator_in(1);
  device.product_name = "\x1b[2J\nprofile";
  device.manufacturer = "\x9b\x31m";
  device.serial = "\r\x07";
  KnownProfiles known = kShipped;
  for (DeviceProfile& profile : known.profiles) profile.match.serial = "A1";
  for (const KnownProfiles& profiles : {known, kShipped}) {
    const std::string text = device_list(std::vector{device}, profiles, true, open_to_root);
    CHECK(std::all_of(text.begin(), text.end(), [](char c) { return c == '\n' || (c >= ' ' && c <= '~'); }));
    CHECK(holds(text, "\"?[2J?profile\" of ?1m, serial number ??\n"));
  }
}

// --- the program ------------------------------------------------------------------------------------------

#if !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)  // umockdev and the sanitizers must both be loaded first
/// Returns a HID device in the format of umockdev-record: USB device, interface, HID device and node.
std::string mock_hid(int port, const std::string& vendor, const std::string& product, const std::string& name,
                     const std::string& serial, const Bytes& descriptor) {
  const std::string n = std::to_string(port);
  const std::string usb = "/devices/pci0000:00/usb3/3-" + n;
  const std::string interface = usb + "/3-" + n + ":1.0";
  const std::string hid_device = interface + "/0003:" + vendor + ":" + product + ".000" + n;
  return "P: " + usb + "\nN: bus/usb/003/00" + n +
         "\nE: DEVTYPE=usb_device\nE: SUBSYSTEM=usb\nE: DEVNAME=/dev/bus/usb/003/00" + n +
         "\nA: idVendor=" + vendor + "\nA: idProduct=" + product + "\nA: product=" + name +
         (serial.empty() ? "" : "\nA: serial=" + serial) + "\n\nP: " + interface +
         "\nE: DEVTYPE=usb_interface\nE: SUBSYSTEM=usb\nA: bInterfaceNumber=00\nA: "
         "bInterfaceClass=03\n\nP: " +
         hid_device + "\nE: SUBSYSTEM=hid\nH: report_descriptor=" + hex_text(descriptor) +
         "\n\nP: " + hid_device + "/hidraw/hidraw" + n + "\nN: hidraw" + n +
         "\nE: SUBSYSTEM=hidraw\nE: DEVNAME=/dev/hidraw" + n + "\nE: MAJOR=243\nE: MINOR=" + n + "\n\n";
}

/// Returns the output of `wrenchctl devices` on a machine without other devices.
std::string printed(const std::string& devices, const std::string& options = {}) {
  const TemporaryDirectory dir;
  const auto file = dir.write("devices", devices);
  const std::string out = (dir.path() / "out").string();
  const std::string command = "umockdev-run -d " + file.string() + " -- " + test::program_path("wrenchctl") +
                              " devices " + options + " > " + out;
  REQUIRE(std::system(command.c_str()) == 0);
  std::ifstream stream(out);
  return {std::istreambuf_iterator<char>(stream), {}};
}

TEST_CASE("wrenchctl devices lists the devices of udev", "[list_devices]") {
  const std::string devices = mock_hid(1, "046d", "c626", "SpaceNavigator", "", space_navigator()) +
                              mock_hid(2, "1209", "0001", "handle", "A1", reference_descriptor()) +
                              mock_hid(3, "04d9", "1702", "USB Keyboard", "", boot_keyboard());
  const std::string text = printed(devices);
  INFO(text);
  const std::size_t second = text.find("3-2, interface 0: 1209:0001 \"handle\", serial number A1\n");
  REQUIRE(second != std::string::npos);
  CHECK(text.find("3-1, interface 0: 046d:c626 \"SpaceNavigator\", no serial number\n") == 0);
  CHECK(holds(text.substr(0, second), "\n  /dev/hidraw1 can be opened\n  profile spacemouse_split: "));
  CHECK(holds(text.substr(0, second), "\n  the report descriptor agrees with the profile\n"));
  CHECK(holds(text.substr(second), "\n  profile reference_full_speed: "));
  CHECK(holds(text, "\n  3-3: 04d9:1702 \"USB Keyboard\", 01:06 (keyboard); no profile matches\n"));
  CHECK(holds(printed(devices, "--all"), "3-3, interface 0: 04d9:1702 \"USB Keyboard\", no serial number\n"));
}

TEST_CASE("wrenchctl devices without a connected device", "[list_devices]") {
  const std::string unrelated_device =
      "P: /devices/virtual/mem/null\nN: null\nE: SUBSYSTEM=mem\nE: DEVNAME=/dev/null\n";
  CHECK(printed(unrelated_device).find("No device is connected: ") == 0);
}
#endif

}  // namespace
}  // namespace wrenchd::test_list_devices
