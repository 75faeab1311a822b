// SPDX-License-Identifier: GPL-3.0-or-later
#include <catch2/catch.hpp>

#include "config/known_profiles.hpp"
#include "devices/discovery/choose_device.hpp"
#include "tests/support/paths.hpp"
#include "tests/support/sample_descriptors.hpp"

namespace wrenchd::test_choose_device {

namespace {

using namespace test;
using Catch::Contains;

const std::vector<DeviceProfile> kShipped =
    known_profiles(SearchPath({test::source_path("config")})).profiles;

UsbDevice reference(const std::string& serial) {
  UsbDevice device;
  device.port_path = "3-1";
  device.hidraw_node = "/dev/hidraw1";
  device.usb_node = "/dev/bus/usb/003/001";
  device.interface = 0;
  device.vendor = 0x1209;
  device.product = 0x0001;
  device.serial = serial;
  device.report_descriptor = reference_descriptor();
  device.usage_page = 0xff00;
  device.usage = 1;
  return device;
}

UsbDevice falcon() {
  UsbDevice device;
  device.port_path = "3-2";
  device.usb_node = "/dev/bus/usb/003/002";
  device.interface = 0;
  device.vendor = 0x0403;
  device.product = 0xcb48;
  device.product_name = "FALCON HAPTIC";
  return device;
}

DeviceChoice choose(const std::vector<UsbDevice>& plugged, const DeviceCriteria& wanted) {
  return choose_device(plugged, kShipped, wanted);
}

std::string picked(const DeviceChoice& choice) {
  return choice.selection ? kShipped[choice.selection->profile].name : "none";
}

}  // namespace

TEST_CASE("the device of the named profile is selected", "[choose_device]") {
  const DeviceChoice choice = choose({falcon(), reference("A")}, {.profile = "reference_full_speed"});
  REQUIRE(picked(choice) == "reference_full_speed");
  CHECK(choice.selection->device == 1);
  CHECK_THAT(choice.rejections[0], Contains("reference_full_speed") && Contains("0403:cb48"));
  CHECK(choice.rejections[1].empty());
}

TEST_CASE("without a name any device with a profile is selected", "[choose_device]") {
  CHECK(picked(choose({falcon()}, {})) == "falcon");
  CHECK(picked(choose({reference("A")}, {})) == "reference_full_speed");
  CHECK(picked(choose({}, {})) == "none");
}

TEST_CASE("a device without a profile is rejected with a hint", "[choose_device]") {
  UsbDevice stranger = reference("A");
  stranger.vendor = 0x1234;
  const DeviceChoice choice = choose({stranger}, {});
  CHECK_FALSE(choice.selection);
  CHECK_THAT(choice.rejections[0], Contains("wrenchctl devices"));
}

TEST_CASE("two equal devices are distinguished by serial number alone", "[choose_device]") {
  const std::vector<UsbDevice> two = {reference("A"), reference("B")};
  const DeviceChoice either = choose(two, {.profile = "reference_full_speed"});
  CHECK_FALSE(either.selection);
  CHECK_THAT(either.rejections[0], Contains("serial number A") && Contains("other devices match too") &&
                                       Contains("serial = \"A\""));
  CHECK_THAT(either.rejections[1], Contains("serial number B"));
  const DeviceChoice second = choose(two, {.profile = "reference_full_speed", .serial = "B"});
  REQUIRE(second.selection);
  CHECK(second.selection->device == 1);
  CHECK_THAT(second.rejections[0], Contains("requires serial number B"));
  CHECK_FALSE(choose(two, {.profile = "reference_full_speed", .serial = "C"}).selection);
}

TEST_CASE("after unplugging only the same device is selected", "[choose_device]") {
  const DeviceCriteria wanted = {.profile = "reference_full_speed", .previous = reference("A")};
  UsbDevice elsewhere = reference("A");
  elsewhere.port_path = "1-7";
  elsewhere.hidraw_node = "/dev/hidraw9";
  CHECK(choose({elsewhere}, wanted).selection);
  const DeviceChoice other = choose({reference("B")}, wanted);
  CHECK_FALSE(other.selection);
  CHECK_THAT(other.rejections[0],
             Contains("not the device that was unplugged") && Contains("restart wrenchd"));
}

TEST_CASE("a device whose reports differ from its profile is not selected", "[choose_device]") {
  UsbDevice other_reports = reference("A");
  other_reports.report_descriptor = from_hex(
      "06 00 ff 09 01 a1 01 15 00 26 ff 00 75 08 85 01 09 02 95 3f 81 02 85 02 09 03 95 0f 91 02 c0");
  const DeviceChoice choice = choose({other_reports}, {.profile = "reference_full_speed"});
  CHECK_FALSE(choice.selection);
  CHECK_THAT(choice.rejections[0], Contains("differs") && Contains("output report"));
  other_reports.report_descriptor = {0x75};
  CHECK_THAT(choose({other_reports}, {.profile = "reference_full_speed"}).rejections[0],
             Contains("is invalid"));
}

TEST_CASE("a profile with endpoints matches only its interface", "[choose_device]") {
  UsbDevice second = falcon();
  second.interface = 1;
  const DeviceChoice choice = choose({second, falcon()}, {.profile = "falcon"});
  REQUIRE(choice.selection);
  CHECK(choice.selection->device == 1);
  CHECK_THAT(choice.rejections[0], Contains("interface 0 of the device, this is 1"));
}

TEST_CASE("a device with a closed protocol is rejected by name", "[choose_device]") {
  UsbDevice touch = reference("A");
  touch.vendor = 0x2988;
  touch.product = 0x0302;
  const DeviceChoice choice = choose({touch}, {});
  CHECK_FALSE(choice.selection);
  CHECK_FALSE(choice.rejections[0].empty());
}

// Two SpaceMice of one model have no serial numbers.
TEST_CASE("two equal devices without serial numbers are distinguished by their USB ports",
          "[choose_device]") {
  UsbDevice left = reference(""), right = reference("");
  left.port_path = "3-1.2";
  right.port_path = "3-1.4";
  const DeviceChoice either = choose({left, right}, {.profile = "reference_full_speed"});
  CHECK_FALSE(either.selection);
  CHECK_THAT(either.rejections[1], Contains("in USB port 3-1.4") && Contains("usb_port = \"3-1.4\""));
  UsbDevice unknown = left;
  unknown.port_path.clear();
  const std::string cure = choose({unknown, right}, {.profile = "reference_full_speed"}).rejections[0];
  CHECK_THAT(cure, Contains("unplug the others") && !Contains("usb_port"));
  const DeviceChoice second = choose({left, right}, {.profile = "reference_full_speed", .usb_port = "3-1.4"});
  REQUIRE(second.selection);
  CHECK(second.selection->device == 1);
  CHECK(second.rejections[0] == "the configuration requires the USB port 3-1.4, it is in 3-1.2");
  // After unplugging, the device in the other port is not taken for it.
  CHECK_FALSE(
      choose({left}, {.profile = "reference_full_speed", .usb_port = "3-1.4", .previous = right}).selection);
}

TEST_CASE("a stock Teensy is not selected for a Polhem unless it is named", "[choose_device]") {
  UsbDevice teensy = reference("12345");
  teensy.vendor = 0x16c0;
  teensy.product = 0x0486;
  teensy.report_descriptor = teensy_rawhid();
  teensy.usage_page = 0xffab;
  teensy.usage = 0x0200;
  CHECK(picked(choose({teensy}, {})) == "none");
  CHECK(picked(choose({teensy}, {.serial = "54321"})) == "none");
  CHECK(picked(choose({teensy}, {.serial = "12345"})) == "polhem");
  CHECK(picked(choose({teensy}, {.profile = "polhem"})) == "polhem");
}

TEST_CASE("a SpaceMouse Enterprise and an unknown SpaceMouse are selected by their descriptors",
          "[choose_device]") {
  UsbDevice mouse = reference("");
  mouse.vendor = 0x256f;
  mouse.usage_page = 1;
  mouse.usage = 8;
  for (const int product : {0xc633, 0xc636, 0xc641}) {
    mouse.product = static_cast<std::uint16_t>(product);
    mouse.report_descriptor = space_mouse_enterprise();
    CHECK(picked(choose({mouse}, {})) == "spacemouse_combined");
  }
  mouse.report_descriptor = home_made_split();
  CHECK(picked(choose({mouse}, {})) == "spacemouse_split");
}

TEST_CASE("a puck with another range than the profile is not selected", "[choose_device]") {
  UsbDevice mouse = reference("");
  mouse.vendor = 0x046d;
  mouse.product = 0xc626;
  mouse.report_descriptor = space_navigator();
  mouse.usage_page = 1;
  mouse.usage = 8;
  CHECK(picked(choose({mouse}, {})) == "spacemouse_split");
  // -32767 to 32767 in place of -350 to 350
  std::string wide = kSplitAxes;
  const std::string range = "16 a2 fe 26 5e 01";
  wide.replace(wide.find(range), range.size(), "16 01 80 26 ff 7f");
  mouse.report_descriptor = from_hex(wide + "c0");
  const DeviceChoice choice = choose({mouse}, {});
  CHECK_FALSE(choice.selection);
  CHECK_THAT(choice.rejections[0],
             Contains("full deflection is 350 counts in the profile; the device counts from "
                      "-32767 to 32767"));
}

}  // namespace wrenchd::test_choose_device
